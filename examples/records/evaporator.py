"""Evaporator, three inputs and three outputs: one model an output or one for all, and what is left over.

Usage: python examples/records/evaporator.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from typing import Any

import common
import modfun as mf
import numpy as np

INPUTS = {"feed": "u1_feed", "vapor": "u2_vapor", "cool": "u3_cooling"}
OUTPUTS = {"matter": "y1_drymatter", "flow": "y2_flow", "temp": "y3_temp"}
POLES = (1, 2, 3, 4, 5)
CUT = 2000  # samples; the last third is predicted


def read(folder: common.Place = None, cooling: str = "foh") -> mf.Record:
    """Feed, vapour and cooling water; dry matter, flow and temperature. The interval is taken as 1."""
    path = common.data("daisy_evaporator_first/evaporator_0_3000.csv", folder)
    held = ["zoh", "zoh", cooling]
    return mf.read(path, time="k", outputs=OUTPUTS, inputs=INPUTS, intersample=held)


def scored(fit: mf.Fit, rec: mf.Record) -> list[common.Array]:
    """S/E (dB) of both parts, and R2 of the second."""
    parts = [fit.score(rec.window(0, CUT - 1)), fit.score(rec.window(CUT, 2999))]
    return [
        np.array(parts[0]["signal_to_error"]),
        *(np.array(parts[1][k]) for k in ("signal_to_error", "r2")),
    ]


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit the first two thirds, predict the last; returns what the page states."""
    rec = read(folder)
    first = rec.window(0, CUT - 1)
    print(rec.check())
    out: dict[str, Any] = {"levels": {}, "fits": {}}
    for n in POLES:
        rows = []
        for name in OUTPUTS:
            one = rec.select(outputs=[name])
            fit = mf.fit(one.window(0, CUT - 1), mf.TransferFunction(poles=n, zeros=n - 1))
            out["fits"][name, n] = fit
            rows.append(scored(fit, one))
        out["levels"][f"{n} poles an output"] = [np.hstack(part) for part in zip(*rows, strict=True)]
    held = read(folder, "zoh").select(outputs=["temp"])
    fit = mf.fit(held.window(0, CUT - 1), mf.TransferFunction(poles=4, zeros=3))
    out["held"] = [float(part[0]) for part in scored(fit, held)]
    shared = mf.TransferFunction(poles=4, zeros=3, denominator="common")
    out["fits"]["common"] = mf.fit(first, shared)
    out["levels"]["4 poles for all"] = scored(out["fits"]["common"], rec)
    columns: dict[str, Any] = {}
    for i, name in enumerate(OUTPUTS):
        for k, (part, digits) in enumerate((("fitted", 1), ("predicted", 1), ("R2", 3))):
            values = [row[k][i] for row in out["levels"].values()]
            columns[f"{name} {part}"] = np.round(values, digits)
    print(f"\nS/E, dB, and R2 of the predicted part\n{mf.Table({'model': list(out['levels'])} | columns)}")
    print(f"\ntemp, 4 poles, cooling held: {out['held'][0]:.1f} fitted, {out['held'][1]:.1f} dB predicted")
    for name in OUTPUTS:
        fit = out["fits"][name, 3]
        gains = {k: (lambda p, k=k: p[f"b2[{k}]"] / p["a3"]) for k in INPUTS}
        print(f"\n{name}, 3 poles\n{fit.damp()}\n{fit.derived(**gains)}")
    if figures:
        draw(out["fits"], rec, figures)
    return out


def draw(fits: dict[Any, mf.Fit], rec: mf.Record, figures: common.Place) -> None:
    """A part that was not fitted."""
    figure, axes = common.panels(3, 1, size=(7.0, 4.4), sharex=True)
    for ax, name in zip(axes, OUTPUTS, strict=True):
        part = rec.select(outputs=[name]).window(CUT, 2999)
        shown = part.t < CUT + 300
        own = fits[name, 4].predict(part)[name]
        ax.plot(part.t[shown], part[name][shown], color="0.6", lw=1.5, label="measured")
        ax.plot(part.t[shown], own[shown], color="C0", lw=1, label="predicted, 4 poles")
        ax.set_ylabel(f"{name} (scaled)")
        ax.grid(alpha=0.3)
    axes[0].legend(fontsize=8, ncols=2)
    axes[-1].set_xlabel("samples")
    common.save(figure, "evaporator", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
