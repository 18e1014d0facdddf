"""Tu-144, stick to pitch rate: a low-order equivalent system with its delay.

K (s + 1/T) e^(-tau s) / (s^2 + 2 zeta omega s + omega^2)

Usage: python examples/records/tu144.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from typing import Any

import common
import modfun as mf
import numpy as np

LATE = mf.TransferFunction(poles=2, zeros=1, delay=mf.Free(max=0.6))
TERMS = {"omega": "sqrt(a2)", "zeta": "a1/(2*sqrt(a2))", "1/T": "b1/b0", "K": "b0"}


def read(folder: common.Place = None) -> mf.Record:
    """Stick (inches) and pitch rate (deg/s), 32 Hz, 20 s."""
    path = common.data("tu144_lon_4d/tu144_f20_4d.csv", folder)
    return mf.read(
        path, time="t_s", outputs={"q": "q_dps"}, inputs={"stick": "lonstk_in"}, intersample="smooth"
    )


def row(fit: mf.Fit, rec: mf.Record) -> dict[str, Any]:
    """What the tables show of a fit: S/E and R2 on a record, delay, frequency and damping with errors."""
    score = fit.score(rec).rows[0]
    found = fit.derived(**{k: TERMS[k] for k in ("omega", "zeta")}).rows
    late = [fit["delay"], fit.bse[-1]] if "delay" in fit.param_names else [fit.structure.delay, 0.0]
    return {
        "S/E, dB": round(score["signal_to_error"], 1),
        "R2": round(score["r2"], 4),
        "delay, s": f"{late[0]:.3f} ± {late[1]:.3f}" if late[1] else f"{late[0]:.2f} held",
        **{f"{one['name']}": f"{one['value']:.2f} ± {one['bse']:.2f}" for one in found},
    }


def table(title: str, rows: dict[str, dict[str, Any]]) -> None:
    """Print rows by name."""
    columns = {key: [row[key] for row in rows.values()] for key in next(iter(rows.values()))}
    print(f"\n{mf.Table({'': list(rows)} | columns, title)}")


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit, print; returns what the page states."""
    rec = read(folder)
    out: dict[str, Any] = {
        "trend": {word: mf.fit(rec, LATE, trend=word) for word in (None, "constant", "linear")}
    }
    table("Trend of the output", {str(word): row(fit, rec) for word, fit in out["trend"].items()})
    fit = out["fit"] = out["trend"]["linear"]

    out["held"] = {
        late: mf.fit(rec, mf.TransferFunction(poles=2, zeros=1, delay=late), trend="linear", band=fit.band)
        for late in (0.0, 0.1, 0.2, 0.24, 0.28, 0.32, 0.4)
    }
    table("Delays held", {f"{late:.2f}": row(one, rec) for late, one in out["held"].items()})

    spans = {"0 to 12 s": (0, 12), "4 to 16 s": (4, 16), "6 to 20 s": (6, 20)}
    out["parts"] = {word: mf.fit(rec.window(*span), LATE, trend="linear") for word, span in spans.items()}
    table(
        "Parts of the record (S/E and R2 on all of it)", {k: row(one, rec) for k, one in out["parts"].items()}
    )

    third = mf.TransferFunction(poles=3, zeros=2, delay=mf.Free(max=0.6))
    out["third"] = mf.fit(rec, third)
    print(f"\nA third pole, constant trend: S/E {out['third'].score()['signal_to_error'][0]:.1f} dB")
    print(out["third"].damp())

    print(f"\n{fit.table()}")
    out["derived"] = fit.derived(omega=TERMS["omega"], zeta=TERMS["zeta"], leads="b1/b0", K="b0")
    print(f"\n{out['derived']}")
    out["collinearity"] = mf.collinearity(rec, fit)
    print(f"\n{out['collinearity']}")

    response = mf.frf(rec, band=(0.3, 12.0))
    gain = fit.frequency_response(response.omega)[0][0]
    apart = np.abs(response.response[0, 0] - gain)
    out["apart"] = np.sqrt(np.mean(apart**2) / np.mean(np.abs(gain) ** 2))
    print(f"\nGains without a model, 0.3 to 12 rad/s: {100 * out['apart']:.1f} % from those of the fit")
    if figures:
        draw(fit, rec, response, figures)
    return out


def draw(fit: mf.Fit, rec: mf.Record, response: mf.FrequencyResponse, figures: common.Place) -> None:
    """The record and its simulation; the frequency response with and without a model."""
    figure, axes = common.panels(2, 2, size=(9.0, 4.4))
    (top, gain), (bottom, phase) = axes
    own = fit.predict(rec)
    top.plot(rec.t, rec["q"], color="0.6", lw=2.5, label="measured")
    top.plot(rec.t, own["q"], color="C0", lw=1, label="model")
    top.plot(rec.t, rec["q"] - own["q"], color="C3", lw=0.8, label="error")
    top.set(ylabel="q, deg/s", ylim=(-2.3, 3.2))
    top.legend(fontsize=8, ncols=3, loc="upper center", frameon=False)
    bottom.plot(rec.t, rec["stick"], color="C2", lw=1)
    bottom.set(xlabel="t, s", ylabel="stick, in")
    mf.plot.bode(fit, response, labels=["fit", "no model"], band=(0.4, 12.0), ax=[gain, phase])
    for ax in (top, bottom):
        ax.grid(alpha=0.3)
    common.save(figure, "tu144", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
