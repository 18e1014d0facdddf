"""Ball and beam: poles held at zero against free ones, and which noise a double integrator has.

Usage: python examples/records/ball_beam.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from typing import Any

import common
import modfun as mf
import numpy as np

LATE = mf.Free(min=0, max=0.5)  # s
HELD = {"a1": 0.0, "a2": 0.0}
MODELS = {
    "held, noise of the output": (HELD, "output"),
    "held, noise of the equation": (HELD, "equation"),
    "free, noise of the output": (None, "output"),
    "free, noise of the equation": (None, "equation"),
}
WINDOWS = (5.0, 10.0, 25.0)  # s


def read(folder: common.Place = None) -> mf.Record:
    """Position of the ball and angle of the beam, 10 Hz."""
    path = common.data("daisy_ballbeam/ballbeam.csv", folder)
    return mf.read(path, time="t_s", outputs={"r": "y_pos"}, inputs={"angle": "u_angle"})


def median_level(fit: mf.Fit, rec: mf.Record, length: float) -> float:
    """Median signal-to-error ratio, dB, of windows that each have an initial state of their own."""
    return float(np.median([fit.score(part)["signal_to_error"][0] for part in rec.split(every=length)]))


def shown(fit: mf.Fit, name: str) -> str:
    """An estimate and its standard error, if it has one."""
    if name in fit.at_bound:
        return f"{fit[name]:.3f} (bound)"
    return f"{fit[name]:.3f} ± {fit.bse[fit.param_names.index(name)]:.3f}"


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit the first half, predict windows of the second; returns what the page states."""
    rec = read(folder)
    print(rec.check())
    first, second = rec.window(0, 50), rec.window(50, 99.9)
    fits = {}
    for name, (params, noise) in MODELS.items():
        structure = mf.TransferFunction(poles=2, zeros=0, params=params, delay=LATE)
        fits[name] = mf.fit(first, structure, noise=noise)
    late = fits[name]["delay"]
    structure = mf.TransferFunction(poles=2, zeros=0, delay=late)
    fits["free, noise of both"] = mf.fit(first, structure, noise="process")
    fits["free, the other half"] = mf.fit(second, fits[name].structure, noise="equation")
    columns: dict[str, Any] = {"model": list(fits)}
    for name in ("a1", "a2", "b0", "delay"):
        told = f"{late:.3f}" if name == "delay" else "0"
        columns[name] = [shown(fit, name) if name in fit.param_names else told for fit in fits.values()]
    print(f"\n{mf.Table(columns)}")
    out: dict[str, Any] = {"fits": fits, "levels": {}}
    for name, fit in fits.items():
        unseen = first if "other" in name else second
        out["levels"][name] = [median_level(fit, unseen, length) for length in WINDOWS]
    columns = {
        f"{length:g} s": [row[i] for row in out["levels"].values()] for i, length in enumerate(WINDOWS)
    }
    rounded: dict[str, Any] = {name: np.round(values, 1) for name, values in columns.items()}
    print(
        f"\nMedian S/E, dB, over windows of the half not fitted\n{mf.Table({'model': list(fits)} | rounded)}"
    )

    print(f"\n{fits['free, noise of both'].process_noise()}")
    best = fits["free, noise of the equation"]
    print(f"\n{best.damp()}")
    out["score"] = best.score(second).rows[0]
    print(f"Second half as one window: {out['score']['signal_to_error']:.1f} dB, R2 {out['score']['r2']:.3f}")
    if figures:
        draw(fits, second, figures)
    return out


def draw(fits: dict[str, mf.Fit], rec: mf.Record, figures: common.Place) -> None:
    """Windows of 10 s of the second half."""
    figure, axes = common.panels(2, 1, sharex=True)
    for part in rec.split(every=10.0):
        for ax, name, color in (
            (axes[0], "held, noise of the equation", "C3"),
            (axes[1], "free, noise of the equation", "C0"),
        ):
            ax.plot(part.t, 100 * part["r"], color="0.6", lw=2.5)
            ax.plot(part.t, 100 * fits[name].predict(part)["r"], color=color, lw=1)
            ax.set_title(f"poles {name.split(',')[0]}", fontsize=10)
            ax.axvline(part.t[0], color="0.85", lw=0.8)
            ax.set_ylabel("100 r")
    axes[1].set_xlabel("t, s (a new initial state every 10 s)")
    common.save(figure, "ball_beam", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
