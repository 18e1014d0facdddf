"""F-18 HARV at 15 to 23 degrees angle of attack: stabilator to angle of attack and pitch rate.

S/E a channel for two and three poles, one denominator for both outputs [25] or one each [26], beside the
report's 8–12 dB; what the state at the beginning and the mean have to do with it.

    MODFUN_DATA=folder python examples/records/f18_longitudinal.py [--figures docs/figures]
"""

from typing import Any

import modfun as mf
import numpy as np
from common import Array, Place, data, panels, run, save

FAST = 25.0  # rad/s, far above the aircraft's own motion
OUTPUTS = ["alpha_deg", "q_dps"]


def structure(poles: int, denominator: str) -> mf.TransferFunction:
    """Transfer functions with one zero fewer than poles."""
    return mf.TransferFunction(poles=poles, denominator=denominator)


def signal_to_error(y: Array, e: Array, about_mean: bool = True) -> Array:
    """dB a channel."""
    signal = np.std(y, axis=1) if about_mean else np.sqrt(np.mean(y**2, axis=1))
    level: Array = 20 * np.log10(signal / np.sqrt(np.mean(e**2, axis=1)))
    return level


def above(e: Array, rec: mf.Record) -> Array:
    """Power of each channel above FAST, in per cent."""
    power = np.abs(np.fft.rfft(e - e.mean(axis=1, keepdims=True))) ** 2
    omega = 2 * np.pi * np.fft.rfftfreq(e.shape[1], rec.t[1] - rec.t[0])
    share: Array = 100 * power[:, omega > FAST].sum(axis=1) / power.sum(axis=1)
    return share


def main(folder: Place = None, figures: Place = None) -> dict[str, Any]:
    """The tables of the page."""
    path = data("f18harv_lon_153b/f18harv_153b.csv", folder)
    rec = mf.read(path, outputs=OUTPUTS, inputs=["stab_deg"])
    print(f"{rec.check()}\n{rec.noise_level()}\n")
    fits, rows = {}, []
    for poles in (2, 3):
        for denominator in ("common", "separate"):
            fit = mf.fit(rec, structure(poles, denominator))
            fits[poles, denominator] = fit
            rows.append([poles, denominator, *fit.score()["signal_to_error"], *fit.score()["r2"]])
    names = ["poles", "denominator", "alpha, dB", "q, dB", "alpha, R2", "q, R2"]
    table = mf.Table(dict(zip(names, zip(*rows, strict=True), strict=True)))
    print(f"{table}\n")

    fit = fits[3, "common"]
    print(f"3 poles:\n{fit.damp()}\n2 poles:\n{fits[2, 'common'].damp()}\n\n{fit.table()}\n\n{fit.check()}\n")
    fast = above(fit.errors(rec), rec)
    print(f"above {FAST:g} rad/s: {fast[0]:.0f} % of the error of alpha, {fast[1]:.0f} % of that of q\n")
    observed = fit.predict(rec, initial_state=fit.initial_state(rec, "observer"))
    ways = {
        "least squares": fit.errors(rec),
        "observer": rec.y - observed.y,
        "zero": rec.y - fit.predict(rec, initial_state="zero").y,
    }
    levels = {f"{way}, mean": signal_to_error(rec.y, e) for way, e in ways.items()}
    levels["least squares, about zero"] = signal_to_error(rec.y, ways["least squares"], about_mean=False)
    print(
        mf.Table(
            {
                "initial state": list(levels),
                **dict(zip(OUTPUTS, zip(*levels.values(), strict=True), strict=True)),
            }
        )
    )
    if figures is not None:
        draw(rec, fits, figures)
    return {"scores": table, "fits": fits, "levels": levels, "fast": fast}


def draw(rec: mf.Record, fits: dict[tuple[int, str], mf.Fit], figures: Place) -> None:
    """Both outputs, measured and simulated, and the stabilator."""
    figure, axes = panels(3, 1, size=(7.0, 4.6), sharex=True)
    for i, (ax, name) in enumerate(zip(axes, ("α (deg)", "q (deg/s)"), strict=False)):
        ax.plot(rec.t, rec.y[i], color="0.6", linewidth=2.0, label="measured")
        for poles, line in ((2, "C1--"), (3, "C0-")):
            simulated = fits[poles, "common"].predict(rec).y[i]
            level = signal_to_error(rec.y[i : i + 1], rec.y[i : i + 1] - simulated)[0]
            ax.plot(rec.t, simulated, line, linewidth=1.1, label=f"{poles} poles: {level:.1f} dB")
        ax.set_ylabel(name)
    axes[2].plot(rec.t, rec["stab_deg"], color="0.3", linewidth=1.1)
    axes[2].set_ylabel("stabilator (deg)")
    axes[2].set_xlabel("time (s)")
    for ax in axes:
        ax.grid(True, alpha=0.3)
    for ax in axes[:2]:
        ax.legend(fontsize="small", ncols=3, frameon=False, loc="lower left", bbox_to_anchor=(0, 1, 1, 0.1))
    save(figure, "f18_longitudinal", figures)


if __name__ == "__main__":
    run(main, __doc__)
