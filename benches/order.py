"""How often criteria find the true orders: writes a section of docs/order.md.

    python benches/order.py [records]

All criteria judge the same costs of the same records, those of `select_order`'s table.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import modfun as mf
import numpy as np

PAGE = Path(__file__).resolve().parents[1] / "docs" / "order.md"
HEADING = "## True orders found"
SYSTEMS = {
    "5/(s² + 3s + 8)": ([5.0], [1.0, 3.0, 8.0], (2, 0)),
    "(6s + 12)/((s + 1)(s² + 1.2s + 9))": ([6.0, 12.0], np.polymul([1.0, 1.0], [1.0, 1.2, 9.0]), (3, 1)),
}
POLES = range(1, 6)
LEVELS = (0.1, 0.4)
COLUMNS = (
    "AIC",
    "AICc",
    "BIC",
    "cost/σ² + p log N",
    "cost/σ² + 2p log N",
    "`select_order`",
    "true pair within 2",
)


def verdicts(system: str, nsr: float, seed: int) -> list[bool]:
    """Whether each criterion finds the true orders of one record; and whether a true pair seems to cancel."""
    num, den, true = SYSTEMS[system]
    plant = mf.tf(num, den)
    rec = mf.simulate(plant, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=nsr, seed=seed)
    found = mf.select_order(rec, poles=POLES)
    poles, zeros, cost = (found.table[name] for name in ("poles", "zeros", "cost"))
    n = np.round(cost / found.table["residual"] ** 2)
    p = poles + zeros + 1
    level, chi2 = n * np.log(cost / n), found.table["chi2"]
    criteria = [
        level + 2 * p,
        level + 2 * (p + 1) * n / (n - p - 2),
        level + p * np.log(n),
        chi2 + p * np.log(n),
        chi2 + 2 * p * np.log(n),
    ]
    picks = [int(np.nanargmin(c)) for c in criteria]
    best = found.best.structure
    pair = found.table["cancelling"][(poles == true[0]) & (zeros == true[1])]
    blurred = pair[0] is not None and float(pair[0]) < 2
    return [(poles[k], zeros[k]) == true for k in picks] + [(best.poles, best.zeros) == true, blurred]


def section(records: int) -> str:
    """The section as Markdown."""
    lines = [
        HEADING,
        "",
        f"Per cent of {records:,} records, with the Monte Carlo standard error; u = sin(t²/5), T = 10 s, "
        "N = 256, start from rest, white noise on the output, candidates of 1 to 5 poles with every "
        "smaller number of zeros (15), all other options at their defaults. p counts the parameters. "
        "The column of 2p shows what a heavier penalty would win and lose; the last, how often a pole and "
        "a zero of the true candidate lie within two standard errors. "
        "Written by `python benches/order.py`.",
        "",
        "| system | NSR | " + " | ".join(COLUMNS) + " |",
        "|---" * (2 + len(COLUMNS)) + "|",
    ]
    with ProcessPoolExecutor(2) as pool:
        for system in SYSTEMS:
            for nsr in LEVELS:
                hits = np.array(list(pool.map(partial(verdicts, system, nsr), range(records), chunksize=20)))
                rate = hits.mean(axis=0)
                error = np.sqrt(rate * (1 - rate) / records)
                cells = [f"{100 * r:.1f} ± {100 * e:.1f}" for r, e in zip(rate, error, strict=True)]
                lines.append(f"| {system} | {nsr} | " + " | ".join(cells) + " |")
                print(lines[-1], flush=True)
    return "\n".join(lines)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent / "compare"))
    from section import write

    write(PAGE, HEADING, section(int(sys.argv[1]) if len(sys.argv) > 1 else 1000))
