"""Heat exchanger: an input paired with the wrong sample, a transit time, and a gain that grows with the flow.

Usage: python examples/records/exchanger.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from typing import Any

import common
import modfun as mf
import numpy as np

PARTS = {"fitted": (2015, 3000), "next": (3010, 3990), "first": (215, 800), "low flow": (830, 1990)}  # s
TUBE = mf.TransferFunction(
    poles=1, zeros=0, delay=[0.0, mf.Free(6.0, min=4, max=8)], params={"a1": 0.0}
)  # what enters, and the same a transit time ago
TWO = mf.TransferFunction(poles=2, zeros=0)
MODELS = {  # structure, samples by which the flow is taken earlier, power of the flow, copies of it
    "as in the file": (mf.TransferFunction(poles=2, zeros=1), 0, 1, 1),
    "one sample earlier": (TWO, 1, 1, 1),
    "transit time": (TUBE, 1, 1, 2),
    "flow squared": (TWO, 1, 2, 1),
    "squared, three poles": (mf.TransferFunction(poles=3, zeros=2), 1, 2, 1),
    "squared, transit time": (TUBE, 1, 2, 2),
}


def read(folder: common.Place = None, earlier: int = 0, power: int = 1, copies: int = 1) -> mf.Record:
    """Outlet temperature, and the flow (raised to a power) held over each second."""
    path = common.data("daisy_exchanger/exchanger.csv", folder)
    rec = mf.read(path, time="t_s", outputs={"temp": "th_temp"}, inputs={"flow": "q_flow"})
    kept = rec.t.size - earlier
    return mf.Record(
        y=rec.y[:, :kept],
        u=[rec["flow"][earlier:] ** power] * copies,
        t=rec.t[:kept],
        outputs=["temp"],
        inputs=["flow"] if copies == 1 else ["in", "out"],
        intersample="zoh",
    )


def pulse_response(rec: mf.Record, length: int = 40) -> tuple[common.Array, list[float]]:
    """Response to a second of flow by least squares, sample by sample, and its S/E on the parts, dB."""
    flow, temp = rec["flow"], rec["temp"]
    rows = np.column_stack([np.roll(flow, lag) for lag in range(length)] + [np.ones(flow.size)])
    own = {name: slice(start + length, stop) for name, (start, stop) in PARTS.items()}
    found = np.linalg.lstsq(rows[own["fitted"]], temp[own["fitted"]], rcond=None)[0].astype(float)
    errors = temp - rows @ found
    levels = [20 * np.log10(np.std(temp[part]) / np.std(errors[part])) for part in own.values()]
    return found[:length], levels


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit one part, predict the others; returns what the page states."""
    out: dict[str, Any] = {"fits": {}, "levels": {}}
    out["pulse"], bound = pulse_response(read(folder))
    print("Change of the temperature 0, 1, 2 ... s after a second of unit flow:")
    print(" ".join(f"{value:.2f}" for value in out["pulse"][:10]))
    records = {}
    for name, (structure, *how) in MODELS.items():
        records[name] = read(folder, *how)
        parts = [records[name].window(*span) for span in PARTS.values()]
        fit = out["fits"][name] = mf.fit(parts[0], structure)
        out["levels"][name] = [fit.score(part)["signal_to_error"][0] for part in parts]
    found = mf.select_order(records["one sample earlier"].window(*PARTS["fitted"]), poles=range(1, 4))
    out["order"] = (found.best.structure.poles, found.best.structure.zeros)
    print(f"\nOrder chosen, flow a sample earlier: {out['order']}")
    for name, fit in out["fits"].items():
        values = [
            f"{n} {v:.3f} ± {s:.3f}" for n, v, s in zip(fit.param_names, fit.params, fit.bse, strict=True)
        ]
        print(f"{name}: {', '.join(values)}")
    rows = out["levels"] | {"40 free numbers": bound}
    columns: dict[str, Any] = {
        part: np.round([row[i] for row in rows.values()], 1) for i, part in enumerate(PARTS)
    }
    print(f"\nS/E, dB\n{mf.Table({'model': list(rows)} | columns)}")
    out["gain"] = {
        name: out["fits"][name].derived(gain="b0/a2").rows[0]
        for name in ("one sample earlier", "flow squared")
    }
    for name, gain in out["gain"].items():
        print(f"gain, {name}: {gain['value']:.1f} ± {gain['bse']:.1f}")
    if figures:
        draw(out, records, figures)
    return out


def draw(out: dict[str, Any], records: dict[str, mf.Record], figures: common.Place) -> None:
    """The pulse response, and 150 s that were not fitted."""
    figure, axes = common.panels(1, 2, width_ratios=[1, 2.4])
    axes[0].stem(np.arange(13), out["pulse"][:13], basefmt="0.7")
    axes[0].set_xlabel("s after the sample of the flow")
    axes[0].set_ylabel("temperature per flow and second")
    measured = records["as in the file"].window(3200, 3350)
    axes[1].plot(measured.t, measured["temp"], color="0.6", lw=2.5, label="measured")
    for name, color in (("as in the file", "C3"), ("squared, three poles", "C0")):
        own = out["fits"][name].predict(records[name].window(*PARTS["next"])).window(3200, 3350)
        axes[1].plot(own.t, own["temp"], color=color, lw=1, label=name)
    axes[1].set_xlabel("t, s")
    axes[1].set_ylabel("outlet temperature")
    axes[1].legend(fontsize=8)
    for ax in axes:
        ax.grid(alpha=0.3)
    common.save(figure, "exchanger", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
