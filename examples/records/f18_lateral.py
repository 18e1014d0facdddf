"""F-18 HARV at 40 degrees angle of attack: aileron and rudder to sideslip, roll rate and yaw rate.

S/E a channel for two and three poles, one denominator for all outputs [25] or one each [26], beside the
report's 9–12 dB, for the whole record and for two parts of it; and why no linear model has the whole.

    MODFUN_DATA=folder python examples/records/f18_lateral.py [--figures docs/figures]
"""

from typing import Any

import modfun as mf
import numpy as np
from common import Place, data, panels, run, save

OUTPUTS, INPUTS = ["beta_deg", "p_dps", "r_dps"], ["ail_deg", "rdr_deg"]
PARTS = {"whole": (0.0, 28.0), "first": (5.0, 13.8), "second": (12.5, 22.0)}  # s


def fitted(
    rec: mf.Record, poles: int, denominator: str, method: str = "awls", band: float | None = 8.0
) -> mf.Fit:
    """Transfer functions with one zero fewer than poles."""
    return mf.fit(rec, mf.TransferFunction(poles=poles, denominator=denominator), method=method, band=band)


def scores(parts: dict[str, mf.Record]) -> tuple[mf.Table, dict[tuple[str, int, str], mf.Fit]]:
    """S/E a channel and the fastest growing pole, by part, method and structure."""
    rows, fits = [], {}
    for part, rec in parts.items():
        for poles in (2, 3):
            for denominator in ("common", "separate"):
                fit = fits[part, poles, denominator] = fitted(rec, poles, denominator)
                growing = max(pole.real for pole in fit.damp()["pole"])
                rows.append(
                    [part, poles, denominator, *fit.score()["signal_to_error"].round(1), round(growing, 2)]
                )
    names = ["part", "poles", "denominator", "beta", "p", "r", "growing, rad/s"]
    return mf.Table(dict(zip(names, zip(*rows, strict=True), strict=True))), fits


def rudder(rec: mf.Record) -> mf.Table:
    """What the rudder did and what the yaw rate answered, in two stretches."""
    rows = []
    for start, stop in ((5.4, 9.6), (13.5, 18.0)):
        part = rec.window(start, stop)
        span = [float(np.ptp(part[name])) for name in ("rdr_deg", "r_dps", "beta_deg", "ail_deg")]
        rows.append([f"{start:g} to {stop:g} s", *np.round(span, 1)])
    names = ["", "rudder, deg", "r, deg/s", "beta, deg", "aileron, deg"]
    return mf.Table(dict(zip(names, zip(*rows, strict=True), strict=True)))


def main(folder: Place = None, figures: Place = None) -> dict[str, Any]:
    """The tables of the page."""
    path = data("f18harv_lat_342l/f18harv_342l.csv", folder)
    rec = mf.read(path, outputs=OUTPUTS, inputs=INPUTS)
    print(f"{rec.check()}\n{rec.noise_level()}\n")
    table, fits = scores({part: rec.window(*span) for part, span in PARTS.items()})
    print(f"S/E, dB\n{table}\n")
    moved = rudder(rec)
    print(f"largest less smallest value\n{moved}\n")
    whole = fitted(rec, 2, "common", "ml", band=None)
    print(f"whole, 2 poles, ml:\n{whole.damp()}\n")
    second = fits["second", 3, "common"]
    print(f"second, 3 poles:\n{second.damp()}\n\n{second.table()}\n\n{second.check()}")
    if figures is not None:
        draw(rec, fits, figures)
    return {"scores": table, "fits": fits, "rudder": moved, "whole by ml": whole}


def draw(rec: mf.Record, fits: dict[tuple[str, int, str], mf.Fit], figures: Place) -> None:
    """Roll and yaw rate with the simulations of both parts, and the controls."""
    figure, axes = panels(3, 1, size=(7.0, 5.0), sharex=True)
    for ax, i, name in ((axes[0], 1, "p (deg/s)"), (axes[1], 2, "r (deg/s)")):
        ax.plot(rec.t, rec.y[i], color="0.65", linewidth=1.5, label="measured")
        for part, color in (("first", "C0"), ("second", "C1"), ("whole", "C3")):
            fit = fits[part, 3, "common"]
            simulated = fit.predict()
            line = "--" if part == "whole" else "-"
            ax.plot(simulated.t, simulated.y[i], color + line, linewidth=1.1, label=f"fitted to the {part}")
        ax.set_ylabel(name)
    axes[0].legend(fontsize="small", ncols=4, frameon=False, loc="lower left", bbox_to_anchor=(0, 1, 1, 0.1))
    axes[2].plot(rec.t, rec["ail_deg"], "C2", linewidth=1.1, label="aileron")
    axes[2].plot(rec.t, rec["rdr_deg"], "C4", linewidth=1.1, label="rudder")
    axes[2].legend(fontsize="small", ncols=2, frameon=False, loc="upper right")
    axes[2].set_ylabel("(deg)")
    axes[2].set_xlabel("time (s)")
    for ax in axes:
        ax.grid(True, alpha=0.3)
    save(figure, "f18_lateral", figures)


if __name__ == "__main__":
    run(main, __doc__)
