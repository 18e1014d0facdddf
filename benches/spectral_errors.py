"""Spectral errors beside classical ones and HC3, width and time: a table of docs/explanation/uncertainty.md.

Usage: python benches/spectral_errors.py [--records 4000] [--write]
"""

import argparse
import time
import warnings
from pathlib import Path

import modfun as mf
import numpy as np

PAGE = Path(__file__).resolve().parents[1] / "docs" / "explanation" / "uncertainty.md"
MARK = "<!-- widths -->"
TF2, TF31 = mf.TransferFunction(poles=2, zeros=0), mf.TransferFunction(poles=3, zeros=1)
EQ24 = {"system": mf.tf([5], [1, 3, 8]), "input": "sin(t**2/5)", "duration": 10.0, "intervals": 256}
SINE, SINES = {**EQ24, "input": "sin(2*t)"}, {**EQ24, "input": "sin(2*t) + sin(5*t)"}
SHORT, LONG = {"duration": 20.0, "intervals": 512}, {"duration": 60.0, "intervals": 1024}
LIGHT = {**EQ24, "system": mf.tf([4], [1, 0.3, 4])}
THIRD = {**EQ24, "system": mf.tf([6, 12], [1, 2.2, 10.2, 9])}
CASES = {
    "eq. (24), M = 6": (EQ24, TF2, {"harmonics": 6, "trend": None}),
    "eq. (24), M = 22": (EQ24, TF2, {"harmonics": 22, "trend": None}),
    "eq. (24), M = 40": (EQ24, TF2, {"harmonics": 40, "trend": None}),
    "eq. (24), N = 64, default band": ({**EQ24, "intervals": 64}, TF2, {}),
    "third order with a zero, default band": (THIRD, TF31, {}),
    "light mode (ζ 0.075), default band": (LIGHT, TF2, {}),
    "eq. (24), one sine, 20 s, default band": (SINE | SHORT, TF2, {}),
    "eq. (24), one sine, 60 s, default band": (SINE | LONG, TF2, {}),
    "eq. (24), two sines, 20 s, default band": (SINES | SHORT, TF2, {}),
    "eq. (24), two sines, 60 s, default band": (SINES | LONG, TF2, {}),
}
KINDS = ("spectral", "nonrobust", "HC3")


def measured(setting, model, options, count):
    """Degrees of freedom; standard errors and widths of 95 % intervals (record, parameter) of each kind."""
    clean = mf.simulate(**setting)
    size = 0.1 * np.sqrt(np.mean(clean.y**2))
    noise = size * np.random.default_rng(56).standard_normal((count, *clean.y.shape))
    batch = mf.Batch(y=clean.y + noise, u=clean.u, dt=clean.dt)
    errors, widths = {}, {}
    for kind in KINDS:
        many = mf.fit_many(batch, model, cov_type=kind, progress=False, **options)
        errors[kind], widths[kind] = many.bse_even[many.usable], np.diff(many.conf_int())[many.usable, :, 0]
    return int(np.median(many.df_resid)), errors, widths


def row(name, count):
    """A line of the table: medians over the records, least and greatest of the parameters."""
    degrees, errors, wide = measured(*CASES[name], count)
    pairs = ((errors, "nonrobust"), (wide, "nonrobust"), (wide, "HC3"))
    ratios = [np.median(own["spectral"] / own[other], axis=0) for own, other in pairs]
    told = " | ".join(f"{own.min():.2f} to {own.max():.2f}" for own in ratios)
    return f"| {name} | {degrees} | {told} |"


def cost(harmonics, count=40_000, rounds=7):
    """µs that spectral errors add to a single fit: a fit runs once what a study runs for eight replicates."""
    spent = {kind: [] for kind in KINDS[:2]}
    for _ in range(rounds):
        for kind, own in spent.items():
            one = mf.Estimator(TF2, cov_type=kind, harmonics=harmonics, trend=None)
            study = mf.MonteCarlo(**EQ24, nsr=0.1, estimators={"ml": one}, replicates=count, seed=1)
            start = time.process_time()
            study.run(threads=1, progress=False)
            own.append(time.process_time() - start)
    return 8e6 / count * (min(spent["spectral"]) - min(spent["nonrobust"]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=4000, help="per row (default: %(default)s)")
    parser.add_argument("--write", action="store_true", help=f"write the table into {PAGE.name}")
    given = parser.parse_args()
    warnings.simplefilter("ignore", mf.ModfunWarning)
    lines = [
        "| white noise, NSR 0.1 | degrees of freedom | standard errors over classical "
        "| intervals over classical | intervals over HC3 |",
        "|---|---|---|---|---|",
    ]
    for name in CASES:
        lines.append(row(name, given.records))
        print(lines[-1], flush=True)
    for harmonics in (6, 22, 40):
        print(f"spectral errors in a single fit, M = {harmonics}: {cost(harmonics):.1f} µs", flush=True)
    if given.write:
        head, old = PAGE.read_text().split(MARK + "\n", 1)
        PAGE.write_text(f"{head}{MARK}\n\n" + "\n".join(lines) + "\n\n" + old.split("\n\n", 1)[1])


if __name__ == "__main__":
    main()
