"""Figures of docs/nonlinear.md: measured systems and what their fits predict of the rest of the record.

Usage: python benches/nonlinear_figures.py FOLDER [DATA, default $MODFUN_DATA]
"""

import os
import sys
import warnings
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
sys.path.append(str(Path(__file__).parents[1] / "examples"))

import emps
import modfun as mf
import numpy as np
import silverbox
import tanks
from matplotlib import pyplot as plt


def figure(path, title, unit, t, measured, found, fitted=None):
    """Measured and simulated above, their difference below; what was fitted is grey."""
    fig, (upper, lower) = plt.subplots(
        2, 1, figsize=(7, 4), sharex=True, layout="constrained", height_ratios=[2, 1]
    )
    upper.plot(t, measured, lw=1.5, label="measured")
    upper.plot(t, found, "--", lw=1, label="simulated")
    lower.plot(t, measured - found, "C3", lw=0.8)
    if fitted is not None:
        for axis in (upper, lower):
            axis.axvspan(t[0], fitted, color="0.9", lw=0)
    upper.set(ylabel=unit, title=title, xlim=(t[0], t[-1]))
    upper.legend(loc="upper right")
    lower.set(xlabel="time (s)", ylabel="error")
    fig.savefig(path, dpi=110)
    plt.close(fig)


def main(folder, data):
    warnings.simplefilter("ignore", mf.ModfunWarning)
    u, y = silverbox.read(data)
    fit, _ = silverbox.main(data)
    start = silverbox.FITTED
    found = silverbox.simulated(fit, u[start:])[: y[start:].size]
    shown = slice(4450, 4634)  # .3 s
    t = silverbox.DT * np.arange(start, y.size)[shown]
    title = "Silverbox: 0.3 s of the 25 s after the fit"
    figure(folder / "silverbox.png", title, "y (V)", t, y[start:][shown], found[shown])
    q, velocity, force = emps.read(data)
    fit, _ = emps.main(data)
    middle = q.size // 2
    params = dict(zip(fit.param_names, fit.params, strict=True))
    found = emps.simulated(params, force[middle:], q[middle], velocity[middle])
    t = emps.DT * np.arange(q.size)
    whole = np.concatenate([np.full(middle, np.nan), found])
    figure(folder / "emps.png", "EMPS: fitted on the grey half", "position (m)", t, q, whole, t[middle])
    u, y = tanks.read(data)
    fit, _ = tanks.main(data)
    found = tanks.levels(fit, u, y)
    t = tanks.DT * np.arange(y.size)
    figure(
        folder / "tanks.png",
        "Cascaded tanks: fitted on the grey part",
        "lower level (V)",
        t,
        y,
        found,
        t[tanks.FITTED],
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2] if sys.argv[2:] else os.environ["MODFUN_DATA"]))
