"""Steam generator, a simulated plant: delays path by path, and an output that is linear only after a formula.

Usage: python examples/records/steam_generator.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from typing import Any

import common
import modfun as mf
import numpy as np

INPUTS = {"fuel": "u1_fuel", "air": "u2_air", "ref": "u3_level_ref", "load": "u4_load_dist"}
OUTPUTS = {"p": "y1_drum_pressure_psi", "o2": "y2_O2_pct", "level": "y3_level", "steam": "y4_steam_kgps"}
MODELS = {  # output: poles, and the delay of each input that acts, s; o2 gets the formula of `excess`
    "p": (2, {"fuel": 3.0, "load": 0.0}),
    "level": (3, {"fuel": 9.0, "ref": 12.0, "load": 6.0}),
    "steam": (2, {"fuel": 3.0, "load": 0.0}),
    "o2": (1, {"excess": 3.0}),
}
CARRIED = np.arange(0.7, 1.06, 0.02)  # fuel burnt by a unit of air, tried for o2
LAGS = 60  # samples of the pulse responses


def read(folder: common.Place = None) -> mf.Record:
    """Four inputs, four outputs, every 3 s."""
    path = common.data("daisy_steamgen_first/steamgen_0_4800.csv", folder)
    return mf.read(path, time="t_s", outputs=OUTPUTS, inputs=INPUTS, intersample="zoh")


def pulses(rec: mf.Record, output: str) -> common.Array:
    """Response to a sample of each input, times its standard deviation: (input, lag), by least squares."""
    rows = np.column_stack([np.roll(u, lag) for u in rec.u for lag in range(LAGS)] + [np.ones(rec.t.size)])
    found: common.Array = np.linalg.lstsq(rows[LAGS:], rec[output][LAGS:], rcond=None)[0][:-1]
    found = found.reshape(len(rec.inputs), LAGS) * rec.u.std(axis=1)[:, None]
    return found


def excess(rec: mf.Record, carried: float) -> mf.Record:
    """The record of o2 with one input: per cent of oxygen that burning leaves over, never negative."""
    left = 21 * (1 - rec["fuel"] / np.maximum(carried * rec["air"], 1e-6))
    return mf.Record(
        y=rec["o2"], u=np.maximum(left, 0), t=rec.t, outputs=["o2"], inputs=["excess"], intersample="zoh"
    )


def scored(rec: mf.Record, structure: mf.TransferFunction) -> tuple[mf.Fit, list[float]]:
    """Fit to the first two thirds; the fit, and S/E (dB) there and on the rest, and R2 on the rest."""
    first = rec.window(0, 9600)
    fit = mf.fit(first, structure)
    rows = [fit.score(part).rows[0] for part in (first, rec.window(9600, 14397))]
    return fit, [rows[0]["signal_to_error"], rows[1]["signal_to_error"], rows[1]["r2"]]


def gains(fit: mf.Fit) -> mf.Table:
    """Steady gain of each input, with its standard error."""
    n = fit.structure.poles
    last = {key: f"b{n - 1}[{key}]" if len(fit.inputs) > 1 else f"b{n - 1}" for key in fit.inputs}
    return fit.derived(**{f"from {k}": (lambda p, b=b: p[b] / p[f"a{n}"]) for k, b in last.items()})


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit the first two thirds, predict the last; returns what the page states."""
    rec = read(folder)
    print(rec.check())
    out: dict[str, Any] = {"fits": {}, "levels": {}, "pulses": {name: pulses(rec, name) for name in OUTPUTS}}
    print("\nLevel: response to one sample of each input, 0, 1, 2 ... samples later")
    for name, row in zip(INPUTS, out["pulses"]["level"], strict=True):
        print(f"{name:5}" + "".join(f"{value:7.3f}" for value in row[:8]))
    own = rec.select(outputs=["steam"], inputs=["fuel", "load"])
    late = mf.TransferFunction(poles=2, zeros=1, delay=[mf.Free(min=0, max=9), 0])
    out["delay"], _ = scored(own, late)
    for name in OUTPUTS:  # as the file stands
        plain = mf.TransferFunction(poles=2, zeros=1)
        out["levels"][f"{name}, four inputs"] = scored(rec.select(outputs=[name]), plain)[1]
    tried = {
        carried: scored(excess(rec, carried), mf.TransferFunction(poles=1, zeros=0, delay=3.0))
        for carried in CARRIED
    }
    out["carried"] = max(CARRIED, key=lambda carried: tried[carried][1][0])
    records = {
        name: rec.select(outputs=[name], inputs=list(MODELS[name][1])) for name in ("p", "level", "steam")
    }
    records["o2"] = excess(rec, out["carried"])
    for name, (poles, delay) in MODELS.items():
        structure = mf.TransferFunction(poles=poles, zeros=poles - 1, delay=list(delay.values()))
        out["fits"][name], out["levels"][f"{name}, as below"] = scored(records[name], structure)
    fit = out["delay"]
    print(f"\nsteam: delay of the fuel, estimated: {fit['delay[fuel]']:.2f} ± {fit.bse[-1]:.2f} s")
    columns: dict[str, Any] = dict(
        zip(("fitted", "predicted", "R2 predicted"), zip(*out["levels"].values(), strict=True), strict=True)
    )
    columns = {name: np.round(values, 3 if "R2" in name else 1) for name, values in columns.items()}
    print(f"\nS/E, dB\n{mf.Table({'output': list(out['levels'])} | columns)}")
    print(f"\no2: fuel burnt by a unit of air {out['carried']:.2f}")
    for name, fit in out["fits"].items():
        print(f"\n{name}\n{gains(fit)}\n{fit.damp()}")
    if figures:
        draw(out["fits"], records, figures)
    return out


def draw(fits: dict[str, mf.Fit], records: dict[str, mf.Record], figures: common.Place) -> None:
    """The part that was not fitted."""
    figure, axes = common.panels(4, 1, size=(7.0, 5.0), sharex=True)
    units = {"p": "p, psi", "o2": "O2, %", "level": "level", "steam": "steam, kg/s"}
    for ax, (name, unit) in zip(axes, units.items(), strict=True):
        rec = records[name].window(9600, 14397)
        ax.plot(rec.t, rec[name], color="0.6", lw=2, label="measured")
        ax.plot(rec.t, fits[name].predict(rec)[name], color="C0", lw=0.8, label="predicted")
        ax.set_ylabel(unit)
        ax.grid(alpha=0.3)
    axes[0].legend(fontsize=8, ncols=2)
    axes[-1].set_xlabel("t, s")
    common.save(figure, "steam_generator", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
