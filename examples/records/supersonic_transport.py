"""Supersonic transport, simulated: the true parameters and the delay, and what the measured column is.

Usage: python examples/records/supersonic_transport.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from collections.abc import Callable
from typing import Any

import common
import modfun as mf
import numpy as np
from scipy.ndimage import uniform_filter1d

NAMES = ("a1", "a2", "b0", "b1", "delay")
TRUTH = np.array([0.9, 2.0, 0.4, 0.1, 0.2])  # (0.4 s + 0.1) e^(-0.2 s)/(s^2 + 0.9 s + 2)
LATE = mf.TransferFunction(poles=2, zeros=1, delay=mf.Free(max=0.5))
REPLICATES = 100
Noise = Callable[[np.random.Generator], common.Array]


def read(column: str, folder: common.Place = None) -> mf.Record:
    """Stick (cm), in straight lines between samples, and a column as pitch rate q (deg/s), 32 Hz."""
    path = common.data("sst_pitch_tf_delay/sst_pitch.csv", folder)
    return mf.read(path, time="t_s", outputs={"q": column}, inputs={"stick": "u_stick_cm"}, intersample="foh")


def midpoint(rec: mf.Record) -> tuple[common.Array, common.Array]:
    """The true system by the midpoint rule, its delayed input in straight lines: how the file was made."""
    a, b, c = np.array([[-0.9, -2.0], [1.0, 0.0]]), np.array([1.0, 0.0]), np.array([0.4, 0.1])
    u = np.interp(rec.t - 0.2, rec.t, rec["stick"])
    assert rec.dt is not None  # evenly sampled
    x, y, h = np.zeros(2), np.zeros(rec.t.size), rec.dt
    for k in range(rec.t.size - 1):
        half = x + h / 2 * (a @ x + b * u[k])
        x = x + h * (a @ half + b * (u[k] + u[k + 1]) / 2)
        y[k + 1] = c @ x
    poles = np.log(np.linalg.eigvals(np.eye(2) + h * a + h * h * a @ a / 2).astype(complex)) / h
    return y, np.array([-poles.sum().real, poles.prod().real])


def within(rec: mf.Record, draw: Noise, **options: Any) -> dict[str, common.Array]:
    """Many noisy copies: how many 95 and 99.7 % intervals hold the truth, bias and deviation in %."""
    y = np.array([rec.y + draw(np.random.default_rng([7, k])) for k in range(REPLICATES)])
    many = mf.fit_many(mf.Batch(y=y, u=rec.u[None], dt=rec.dt, intersample="foh"), LATE, **options)
    held = {}
    for level in (0.95, 0.997):
        low, high = np.moveaxis(many.conf_int(level), -1, 0)
        held[f"intervals of {100 * level:g} % that hold the truth"] = 100 * np.mean(
            (low <= TRUTH) & (high >= TRUTH), axis=0
        )
    return held | {
        "bias": 100 * (many.params.mean(axis=0) / TRUTH - 1),
        "deviation": 100 * many.params.std(axis=0) / TRUTH,
    }


def white(size: float) -> Noise:
    """White noise of a standard deviation, as a function of a generator."""
    return lambda rng: size * rng.standard_normal(5241)


def recoloured(error: common.Array) -> Noise:
    """Noise with the spectrum of `error` over nine lines: its colour, not its relation to the stick."""
    size = np.sqrt(uniform_filter1d(np.abs(np.fft.rfft(error - error.mean())) ** 2, 9) / error.size)
    return lambda rng: np.fft.irfft(size * np.fft.rfft(rng.standard_normal(error.size)), error.size)


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit, print; returns what the page states."""
    true, measured = read("ytrue_q_dps", folder), read("z_q_dps", folder)
    clean = mf.fit(true, LATE)
    y, poles = midpoint(true)
    out: dict[str, Any] = {"clean": clean, "midpoint": np.std(true["q"] - y), "poles": poles}
    columns = {"parameter": NAMES, "truth": TRUTH, "estimate": clean.params, "error": clean.params - TRUTH}
    print(f"{mf.Table(columns)}\nS/E {clean.score()['signal_to_error'][0]:.1f} dB")
    print(f"The midpoint rule repeats ytrue to {out['midpoint']:.1e}; a1, a2 of its poles: {poles.round(5)}")

    model = mf.tf([0.4, 0.1], [1, 0.9, 2], delay=0.2)
    exact = true.assign(q=model.simulate(u=true["stick"], dt=true.dt, intersample="foh").ravel())
    out["exact"] = np.max(np.abs(mf.fit(exact, LATE).params - TRUTH))
    far = "below 1e-7" if out["exact"] < 1e-7 else f"{out['exact']:.1e}"  # rounding has no digits to quote
    print(f"Fitted to an exact simulation: largest error {far}")
    error, size = measured["q"] - true["q"], true["q"].std()
    cases: dict[str, Any] = {
        f"ytrue, white {level} %": (true, white(level / 100 * size), {}) for level in (1, 5, 10, 20)
    }
    cases["exact, white 1 %"] = exact, white(0.01 * size), {}
    cases["exact, colour of z"] = exact, recoloured(error), {}
    cases['  with noise="coloured"'] = exact, recoloured(error), {"noise": "coloured"}
    out["studies"] = {name: within(*case, **more) for name, (*case, more) in cases.items()}
    for key in [key for key in out["studies"]["exact, white 1 %"] if key != "bias"]:
        rows = [np.round(found[key], 2) for found in out["studies"].values()]
        columns = {name: [row[j] for row in rows] for j, name in enumerate(NAMES)}
        print(f"\n{mf.Table({'noise': list(cases)} | columns, f'{key}, %')}")

    print("\nThe measured column: estimate ± error (off the truth in errors)")
    out["measured"] = {word: mf.fit(measured, LATE, noise=word) for word in ("output", "coloured")}
    for word, fit in out["measured"].items():
        off = (fit.params - TRUTH) / fit.bse
        shown = zip(NAMES, fit.params, fit.bse, off, strict=True)
        print(f"{word}: " + ", ".join(f"{n} {v:.4f} ± {e:.4f} ({o:+.1f})" for n, v, e, o in shown))
    by_chance = recoloured(error)(np.random.default_rng(1))
    options: dict[str, Any] = {"band": (0.1, 3.0), "halfwidth": 20, "method": "lpm"}
    response, other = (mf.frf(true.assign(q=q), **options) for q in (error, by_chance))
    out["coherence"] = [np.mean(np.asarray(one.coherence)[0, one.omega < 1]) for one in (response, other)]
    related = np.corrcoef(error, true["q"])[0, 1]
    print(f"z - ytrue: standard deviation {error.std():.4f}, correlation with ytrue {related:.2f}")
    print("Coherence with the stick below 1 rad/s: {:.2f}, by chance {:.2f}".format(*out["coherence"]))
    if figures:
        figure_of(clean, true, measured, response, figures)
    return out


def figure_of(
    fit: mf.Fit, true: mf.Record, measured: mf.Record, response: mf.FrequencyResponse, figures: common.Place
) -> None:
    """Both columns, and what of their difference follows the stick, beside the system's own response."""
    figure, (left, right) = common.panels(1, 2, size=(8.0, 3.6))
    left.plot(measured.t, measured["q"], color="0.6", lw=1, label="z")
    left.plot(true.t, true["q"], color="C0", lw=1, label="ytrue")
    left.plot(true.t, measured["q"] - true["q"], color="C3", lw=0.7, label="z − ytrue")
    left.set(xlabel="t, s", ylabel="q, deg/s", xlim=(80, 164))
    circles = response.radius(0.95)
    assert circles is not None  # only of responses without a covariance
    gain, radius = np.abs(response.response[0, 0]), circles[0, 0]
    right.loglog(response.omega, np.abs(fit.frequency_response(response.omega)[0][0]), "C0", label="system")
    right.loglog(response.omega, gain, "C3", label="z − ytrue, without a model")
    right.fill_between(response.omega, np.maximum(gain - radius, 1e-4), gain + radius, color="C3", alpha=0.2)
    right.set(xlabel="frequency, rad/s", ylabel="gain to q, (deg/s)/cm", ylim=(1e-3, 1))
    for ax in (left, right):
        ax.legend(fontsize=8)
        ax.grid(alpha=0.3)
    common.save(figure, "supersonic_transport", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
