"""Buck converter: the limit of a linear model, and the circuit from the parts that are linear.

Usage: python examples/records/buck_converter.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from typing import Any

import common
import modfun as mf
import numpy as np

SUPPLY = 24.0  # V; mean voltage behind the switch: (4 - u) SUPPLY/3, published for this converter
RISING = [(0.0, 0.00055), (0.0055, 0.0063)]  # s: current flows
FALLING = [(0.0030, 0.0036), (0.0070, 0.0074)]  # s: it does not
STEPS = 8  # of the integration, a sample


def read(folder: common.Place = None) -> mf.Record:
    """Control voltage and output voltage, 100 kHz."""
    path = common.data("buck_converter_id/buck_id.csv", folder)
    return mf.read(path, time="t_s", outputs={"v": "y_V"}, inputs={"u": "u_V"}, intersample="zoh")


def simulated(circuit: tuple[float, float, float], rec: mf.Record, state: common.Array) -> common.Array:
    """Output voltage of coil, capacitor, load and a diode: the coil's current never turns round.

    w is the current over C: v' = w - decay v, and w' = a2 mean - (a2 - loss decay) v - loss w while w >= 0,
    which is v'' + a1 v' + a2 v = a2 mean with a1 = loss + decay.
    """
    a1, a2, decay = circuit
    loss = a1 - decay
    step = (rec.t[1] - rec.t[0]) / STEPS
    v, w = state
    out = np.empty(rec.t.size)
    for k, control in enumerate(rec["u"]):
        drive = a2 * (4 - control) * SUPPLY / 3
        out[k] = v
        for _ in range(STEPS):
            w = max(0.0, w + step * (drive - (a2 - loss * decay) * v - loss * w))
            v += step * (w - decay * v)
    return out


def predicted(circuit: tuple[float, float, float], rec: mf.Record) -> common.Array:
    """The simulation from the initial voltage and current that suit the record best."""
    from scipy.optimize import least_squares

    scale = np.array([10.0, 1e4])
    start = np.array([rec["v"][0], rec["v"][0] * circuit[2]]) / scale
    found = least_squares(lambda x: simulated(circuit, rec, x * scale) - rec["v"], start)
    return simulated(circuit, rec, found.x * scale)


def level(rec: mf.Record, own: common.Array) -> float:
    """Signal-to-error ratio, dB, as `fit.score` states it."""
    return float(20 * np.log10(np.std(rec["v"]) / np.sqrt(np.mean((rec["v"] - own) ** 2))))


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit, predict, print; returns what the page states."""
    rec = read(folder)
    print(rec.check())
    halves = [rec.window(0, 0.005), rec.window(0.005, 0.01)]
    out: dict[str, Any] = {}
    linear = mf.fit(halves[0], mf.TransferFunction(poles=2, zeros=0))
    rises = [rec.window(*part) for part in RISING]
    rising = mf.fit(
        rises,
        mf.Equation(f"v'' + a1*v' + a2*v = a2*(4 - u)*{SUPPLY / 3}", outputs=["v"], inputs=["u"]),
    )
    free = mf.fit(rises, mf.Equation("v'' + a1*v' + a2*v = a2*K*(4 - u)", outputs=["v"], inputs=["u"]))
    falls = [rec.window(*part) for part in FALLING]
    falling = mf.fit(falls, mf.Equation("v' + decay*v = 0", outputs=["v"]))
    windows = ([halves[0]], linear), (rises, rising), (falls, falling)
    both = [mf.fit(part, fit.structure, noise="process") for part, fit in windows]
    out["linear"] = [fit_level for part in halves for fit_level in linear.score(part)["signal_to_error"]]
    print(f"\nLinear, first half\n{linear.damp()}\n{linear.derived(gain='b0/a2')}")
    print(f"S/E {out['linear'][0]:.1f} dB, second half, predicted, {out['linear'][1]:.1f} dB")

    print("\nNoise of both kinds: one linear model; rising; falling")
    for fit in both:
        print(f"{fit}\n{fit.process_noise()}")
    out["process"] = [fit.process_noise()["share"][1] for fit in both]

    print(f"\nVoltage falls, no current\n{falling}\n{falling.score()}")
    print(f"\nVoltage rises, current flows\n{rising}\n{rising.score()}")
    out["gain"] = free.derived(gain="K").rows[0]
    print(f"The gain, left free: {-out['gain']['value']:.2f} ± {out['gain']['bse']:.2f} V/V")
    out["rising"] = rising.derived(omega="sqrt(a2)", zeta="a1/(2*sqrt(a2))", LC="1/a2")
    out["falling"] = falling.derived(RC="1/decay")
    print(f"\n{out['rising']}\n{out['falling']}")
    circuit = (rising["a1"], rising["a2"], falling["decay"])
    own = [predicted(circuit, part) for part in halves]
    out["diode"] = [level(part, y) for part, y in zip(halves, own, strict=True)]
    print(f"\nWith the diode: S/E {out['diode'][0]:.1f} and {out['diode'][1]:.1f} dB")
    if figures:
        draw(halves, linear, own, figures)
    return out


def draw(halves: list[mf.Record], linear: mf.Fit, own: list[common.Array], figures: common.Place) -> None:
    """Both models over both halves."""
    figure, axes = common.panels(1, 2, sharey=True)
    for ax, part, y, title in zip(axes, halves, own, ("first half", "second half"), strict=True):
        ax.plot(1e3 * part.t, part["v"], color="0.6", lw=2.5, label="measured")
        ax.plot(1e3 * part.t, linear.predict(part)["v"], color="C3", lw=1, label="linear, of the first half")
        ax.plot(1e3 * part.t, y, color="C0", lw=1, label="with the diode")
        ax.set_title(title, fontsize=10)
        ax.set_xlabel("t, ms")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("v, V")
    axes[1].legend(fontsize=8)
    common.save(figure, "buck_converter", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
