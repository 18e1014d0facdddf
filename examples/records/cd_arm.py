"""CD player arm, two forces and two outputs: poles by cross-validation, and where the record has no input.

Usage: python examples/records/cd_arm.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from typing import Any

import common
import modfun as mf
import numpy as np

BAND = 0.6  # rad a sample: .1 % of the power of the inputs lies above
ORDERS = range(1, 6)


def read(folder: common.Place = None) -> mf.Record:
    """Two forces, two outputs; the sampling interval is not known and is taken as 1."""
    path = common.data("daisy_cd_arm_first/cd_arm_0_1024.csv", folder)
    return mf.read(path, time="k", outputs=["y1", "y2"], inputs=["u1", "u2"])


def structure(poles: int) -> mf.TransferFunction:
    """All four paths share the poles and have as many zeros: forces act within a sample."""
    return mf.TransferFunction(poles=poles, zeros=poles, denominator="common")


def future_helps(rec: mf.Record, future: int, past: int = 20) -> list[float]:
    """S/E (dB) of both outputs in the last third, predicted by least squares on inputs before and after."""
    lags = range(-future, past + 1)
    rows = np.column_stack([np.roll(u, lag) for u in rec.u for lag in lags] + [np.ones(rec.t.size)])
    fitted, rest = slice(60, 682), slice(683, 1000)
    levels = []
    for y in rec.y:
        errors = y - rows @ np.linalg.lstsq(rows[fitted], y[fitted], rcond=None)[0]
        levels.append(10 * np.log10(np.var(y[rest]) / np.var(errors[rest])))
    return levels


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Choose, fit, predict; returns what the page states."""
    rec = read(folder)
    print(rec.check())
    power = np.abs(np.fft.rfft(rec.u, axis=1)) ** 2
    above = 2 * np.pi * np.arange(power.shape[1]) / rec.t.size > BAND
    out: dict[str, Any] = {"above": power[:, above].sum(axis=1) / power.sum(axis=1)}
    print(f"Power of u1, u2 above {BAND} rad a sample: {out['above'][0]:.2%}, {out['above'][1]:.2%}")

    quarters = rec.split(every=255.0)
    estimators = {f"{n} poles": mf.Estimator(structure(n), band=BAND) for n in ORDERS}
    out["table"] = mf.cross_validate(quarters, estimators).summary()
    print(f"\nEach quarter predicted by a fit to the other three, means\n{out['table']}")
    three = mf.fit(quarters[:3], structure(3), band=BAND)
    out["score"] = three.score(quarters[3])
    print(f"\nThree poles of three quarters, the last quarter predicted\n{out['score']}")
    out["fits"] = {n: mf.fit(rec, structure(n), band=BAND) for n in (3, 4)}
    for n, fit in out["fits"].items():
        print(f"\n{n} poles, all of the record\n{fit.damp()}\n{fit.score()}")
    out["future"] = {future: future_helps(rec, future) for future in (0, 5)}
    for future, levels in out["future"].items():
        print(f"\nLeast squares on 21 samples of the inputs and {future} of their future: ", end="")
        print(f"{levels[0]:.1f}, {levels[1]:.1f} dB")
    if figures:
        draw(rec, out["fits"], mf.frf(rec, band=(0.006, 1.2)), figures)
    return out


def draw(rec: mf.Record, fits: dict[int, mf.Fit], frf: mf.FrequencyResponse, figures: common.Place) -> None:
    """Gains of all four paths, with 95 % bands, beside those of the models."""
    figure, axes = common.panels(2, 2, size=(7.0, 4.6), sharex=True, sharey=True)
    radius = frf.radius(0.95)
    assert radius is not None  # only of responses without a covariance
    for o, output in enumerate(rec.outputs):
        for i, force in enumerate(rec.inputs):
            ax, gain = axes[o, i], np.abs(frf.response[o, i])
            low, high = gain - radius[o, i], gain + radius[o, i]
            ax.fill_between(frf.omega, np.maximum(low, 1e-3), high, color="0.85", label="frf, 95 %")
            ax.loglog(frf.omega, gain, color="0.5", lw=1.5)
            for (n, fit), color in zip(fits.items(), ("C0", "C3"), strict=True):
                omega = frf.omega[frf.omega < BAND]
                response = fit.model.frequency_response(omega).response
                ax.loglog(omega, np.abs(response[o, i]), color=color, lw=1, label=f"{n} poles")
            ax.axvline(BAND, color="0.3", lw=0.8, ls=":")
            ax.set_title(f"{force} to {output}", fontsize=10)
            ax.set_ylim(3e-3, 30)
            ax.grid(alpha=0.3)
    axes[0, 1].legend(fontsize=8)
    figure.supxlabel("rad a sample", fontsize=10)
    figure.supylabel("gain", fontsize=10)
    common.save(figure, "cd_arm", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
