"""Intervals where the noise changes during the record: the table of docs/explanation/uncertainty.md.

Usage: python benches/changing_noise.py [--records 1000] [--write]
"""

import argparse
import warnings
from pathlib import Path

import modfun as mf
import numpy as np
from modfun.base.student import student_interval
from scipy.signal import lfilter

PAGE = Path(__file__).resolve().parents[1] / "docs" / "explanation" / "uncertainty.md"
MARK = "<!-- changing noise -->"
LEVELS = {  # of the time from 0 to 1
    "even": np.ones_like,
    "four times as strong on the last 40 %": lambda t: np.where(t > 0.6, 4.0, 1.0),
    "rising from 0.3 to 2.3": lambda t: 0.3 + 2.0 * t,
    "a burst of five times the level": lambda t: 1.0 + 4.0 * np.exp(-(((t - 0.3) / 0.075) ** 2)),
}
EVEN, STEP, RISE, BURST = LEVELS
TF2 = mf.TransferFunction(poles=2, zeros=0)
TWO = mf.TransferFunction(poles=2, zeros=[[0], [1]], denominator="common")
AIRCRAFT = mf.StateSpace(A=[["Zw", "1"], ["Mw", "Mq"]], B=[["0"], ["Mde"]], states=["w", "q"], inputs=["de"])
DUFFING = mf.Equation("y'' + a*y' + b*y + c*y**3 = d*u")
SYSTEMS = {
    "eq. (24), 10 %": (TF2, mf.tf([5], [1, 3, 8]), {"a1": 3.0, "a2": 8.0, "b0": 5.0}, 0.1),
    "two outputs, common poles, 5 %": (
        TWO,
        mf.tf([[[5.0]], [[2.0, 1.0]]], [1, 3, 8]),
        {"a1": 3.0, "a2": 8.0, "b0[y1]": 5.0, "b0[y2]": 2.0, "b1[y2]": 1.0},
        0.05,
    ),
    "state space of an aircraft, 5 %": (
        AIRCRAFT, None, {"Zw": -0.8, "Mw": -4.0, "Mq": -1.5, "Mde": -6.0}, 0.05
    ),
    "Duffing, 5 %": (DUFFING, None, {"a": 0.5, "b": 4.0, "c": 1.0, "d": 3.0}, 0.05),
}  # fmt: skip
CELLS = [
    ("eq. (24), 10 %", STEP, 0.0, 0.0),
    ("eq. (24), 10 %", STEP, 0.0, 0.0, 128),
    ("eq. (24), 10 %", STEP, 0.0, 0.0, 64),
    ("eq. (24), 10 %", EVEN, 0.0, 0.0, 64),
    ("eq. (24), 10 %", STEP, 0.9, 0.0),
    ("eq. (24), 10 %", RISE, 0.0, 0.0),
    ("eq. (24), 10 %", BURST, 0.0, 0.0),
    ("eq. (24), 10 %", EVEN, 0.0, 0.0),
    ("two outputs, common poles, 5 %", STEP, 0.0, 0.6),
    ("two outputs, common poles, 5 %", EVEN, 0.0, 0.6),
    ("state space of an aircraft, 5 %", STEP, 0.0, 0.0),
    ("state space of an aircraft, 5 %", EVEN, 0.0, 0.0),
    ("Duffing, 5 %", STEP, 0.0, 0.0),
    ("Duffing, 5 %", RISE, 0.0, 0.0),
    ("Duffing, 5 %", EVEN, 0.0, 0.0),
]


def batch(name, level, pole, correlation, count, intervals):
    """Records with the same input and noise of that level in time."""
    structure, system, truth, nsr = SYSTEMS[name]
    system = structure.model(truth) if system is None else system
    clean = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=intervals)
    scale = LEVELS[level](np.linspace(0.0, 1.0, intervals + 1))
    size = nsr * np.sqrt(np.mean(clean.y**2, axis=1, keepdims=True) / np.mean(np.square(scale)))
    rng = np.random.default_rng([7, *name.encode(), *level.encode(), int(10 * pole)])
    drawn = rng.standard_normal((count, len(clean.y), scale.size + 300))
    noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], drawn)[..., 300:]
    if correlation:
        root = np.linalg.cholesky(np.full((2, 2), correlation) + (1 - correlation) * np.eye(2))
        noise = np.einsum("ij,rjt->rit", root, noise)
    y = clean.y + size * scale * noise
    return mf.Batch(y, clean.u, clean.dt, outputs=clean.outputs, inputs=clean.inputs)


def row(count, name, level, pole, correlation, intervals=256):
    """Coverage with and without allowance, of the least parameter, width, and records found."""
    structure, _, truth, _ = SYSTEMS[name]
    many = mf.fit_many(batch(name, level, pole, correlation, count, intervals), structure)
    true = np.array([truth[p] for p in many.param_names])
    covered = []
    for errors in (many.bse_even, many.bse):
        low, high = student_interval(many.params, errors, many.degrees, 0.95)
        covered.append(100 * np.mean(((low < true) & (high > true))[many.usable], axis=0))
    width = np.median((many.bse / many.bse_even)[many.usable])
    kind = f"AR({pole:g})" if pole else "white"
    kind += f", correlation {correlation:g}" if correlation else ""
    name += f", N = {intervals}" if intervals != 256 else ""
    return (
        f"| {name} | {level}, {kind} | {covered[0].mean():.1f} | {covered[1].mean():.1f} | "
        f"{covered[1].min():.1f} | {width:.2f} | {100 * many.changing.mean():.1f} |"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=1000, help="per cell (default: %(default)s)")
    parser.add_argument("--write", action="store_true", help=f"write the table into {PAGE.name}")
    given = parser.parse_args()
    warnings.simplefilter("ignore", mf.ModfunWarning)
    lines = [
        "| system | noise | stationary errors | errors of the fit | least parameter | width | found, % |",
        "|---|---|---|---|---|---|---|",
    ]
    for cell in CELLS:
        lines.append(row(given.records, *cell))
        print(lines[-1], flush=True)
    if given.write:
        head, old = PAGE.read_text().split(MARK + "\n", 1)
        PAGE.write_text(f"{head}{MARK}\n\n" + "\n".join(lines) + "\n\n" + old.split("\n\n", 1)[1])


if __name__ == "__main__":
    main()
