"""Noise as it is: what its models cost and bring on the report's example. Prints the table of docs/linear.md.

Usage: python benches/noise.py [records, default 5000]
"""

import sys

import modfun as mf
import numpy as np

TRUE = np.array([3.0, 8.0, 5.0])
KINDS = {"spectral": "spectral", "nonrobust": "classical"}
TF = mf.TransferFunction(poles=2, zeros=0)


def autoregressive(rng, records, samples, pole):
    """AR(1) noise of unit variance, settled before it begins."""
    e = rng.standard_normal((records, samples + 200))
    for k in range(1, e.shape[1]):
        e[:, k] += pole * e[:, k - 1]
    return np.sqrt(1 - pole**2) * e[:, 200:]


def row(name, many):
    """Standard deviations with their Monte Carlo error in per cent, and coverage of 95 % intervals."""
    good = many.params[many.success]
    inside = np.abs(good - TRUE) <= (np.diff(many.conf_int()) / 2)[many.success, :, 0]
    sd = good.std(axis=0, ddof=1)
    error = 100 / np.sqrt(2 * len(good))
    covers = ", ".join(f"{100 * c:.1f}" for c in inside.mean(axis=0))
    spread = ", ".join(f"{s:.3f}" for s in sd)
    print(f"| {name} | {spread} (± {error:.1f} %) | {covers} | {len(many) - len(good)} |", flush=True)


def main(records=5000):
    clean = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    rms = np.sqrt(np.mean(clean.y**2))
    rng = np.random.default_rng(11)
    noise = 0.1 * rms * autoregressive(rng, records, 257, 0.95)
    batch = mf.Batch(y=(clean.y[0] + noise)[:, None], u=clean.u, dt=clean.dt)
    print(f"{records} records, AR(1) noise with pole .95, NSR .1\n")
    print(
        "| noise, lines, errors | sd of a1, a2, b0 | 95 % intervals cover, % | failures |\n|---|---|---|---|"
    )
    for harmonics in (None, 20):
        for kind in ("output", "coloured"):
            for cov_type in KINDS:
                many = mf.fit_many(
                    batch, TF, harmonics=harmonics, noise=kind, cov_type=cov_type, progress=False
                )
                word = "white" if kind == "output" else kind
                lines = round(many.band[1] * 10 / (2 * np.pi))
                row(
                    f"{word}, to line {lines}{'' if harmonics else ' (default)'}, {KINDS[cov_type]}",
                    many,
                )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
