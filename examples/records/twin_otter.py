"""Twin Otter, two elevator manoeuvres: a model of run 018 predicts run 019, stability derivatives of both.

Usage: python examples/records/twin_otter.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from typing import Any

import common
import modfun as mf
import numpy as np

GRAVITY = 32.174  # ft/s2
WING, CHORD, MASS, INERTIA = 422.48, 6.496, 338.8, 24273.0  # ft2, ft, slug, slug ft2: the record's README
CHANNELS = {"alpha": "alpha_deg", "q": "q_dps"}
KEPT = {"V": "V_fps", "qbar": "qbar_psf", "theta": "theta_deg", "az": "az_g"}
SHORT_PERIOD = mf.StateSpace(
    [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"]
)

LATE_VANE = mf.Equation(  # the vane shows alpha h seconds late
    ["alpha' = Za*alpha + q(t-h) + Zd*de(t-h)", "q(t-h)' = Ma*alpha + Mq*q(t-h) + Md*de(t-h)"],
    outputs=["alpha", "q"],
    inputs=["de"],
    params={"h": mf.Free(0.02, min=0, max=0.1)},
)


def read(run: str, folder: common.Place = None) -> mf.Record:
    """Angle of attack (deg), pitch rate (deg/s) and elevator (deg) of a run, 50 Hz."""
    path = common.data(f"twinotter_lon_{run}/twinotter_lon_{run}.csv", folder)
    return mf.read(path, time="t_s", outputs=CHANNELS, inputs={"de": "el_deg"}, keep=KEPT)


def lag(rec: mf.Record) -> tuple[float, float]:
    """Lag of alpha (s) behind what gyroscope and accelerometer say of it, with their agreement (dB).

    alpha' = q + g/V (az cos alpha + cos(theta - alpha)), which holds whatever the aerodynamics.
    """
    alpha, theta = np.deg2rad(rec["alpha"]), np.deg2rad(rec["theta"])
    turn = GRAVITY / rec["V"] * (rec["az"] * np.cos(alpha) + np.cos(theta - alpha))
    return common.lag(rec, "alpha", rec["q"] + np.rad2deg(turn))


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit, predict, print; returns what the page states."""
    runs = {run: read(run, folder) for run in ("018", "019")}
    out: dict[str, Any] = {}

    rate = {run: rec.select(outputs=["q"]) for run, rec in runs.items()}
    tf = mf.fit(rate["018"], mf.TransferFunction(poles=2, zeros=1))
    print(f"Transfer function from elevator to pitch rate, run 018\n{tf}\n{tf.damp()}")
    for run in runs:
        score = tf.score(rate[run]).rows[0]
        out[f"q {run}"] = score
        print(f"q of run {run}: S/E {score['signal_to_error']:.1f} dB, R2 {score['r2']:.4f}")

    print("\nThe vane follows the integrated rates by")
    out["lag"] = {run: lag(rec) for run, rec in runs.items()}
    for run, (late, level) in out["lag"].items():
        print(f"run {run}: {1000 * late:.0f} ms, with which they agree to {level:.1f} dB")

    shifted = {run: common.earlier(rec, "alpha") for run, rec in runs.items()}
    fits = {}
    for word, records in (("", runs), (", alpha earlier", shifted)):
        for name, own in (
            ("018", [records["018"]]),
            ("019", [records["019"]]),
            ("both", [*records.values()]),
        ):
            fits[name + word] = mf.fit(own, SHORT_PERIOD), records
    out["fits"] = {name: fit for name, (fit, _) in fits.items()}
    out["levels"] = {
        name: {run: fit.score(rec)["signal_to_error"] for run, rec in records.items()}
        for name, (fit, records) in fits.items()
    }
    print(f"\nState equations: derivatives ± standard errors, 1/s or 1/s2\n{common.estimates(out['fits'])}")
    columns = {
        f"{c} {run}": [found[run][i] for found in out["levels"].values()]
        for run in runs
        for i, c in enumerate(CHANNELS)
    }
    print(f"\nS/E, dB\n{mf.Table({'fit': list(fits)} | {k: np.round(v, 1) for k, v in columns.items()})}")
    both, last = out["fits"]["both"], out["fits"]["both, alpha earlier"]
    out["late"] = mf.fit([*runs.values()], LATE_VANE, band=both.band, trend="constant")
    print(f"\nBoth runs, the lag h of the vane (s) a parameter\n{out['late'].table()}")
    print(f"\nBoth runs, alpha earlier\n{last.table()}")

    qbar, speed = (np.mean([rec[name].mean() for rec in runs.values()]) for name in ("qbar", "V"))
    moment, force = INERTIA / (qbar * WING * CHORD), MASS * speed / (qbar * WING)
    out["derived"] = last.derived(
        CZa=f"{force}*Za",
        CZde=f"{force}*Zd",
        Cma=f"{moment}*Ma",
        Cmq=f"{moment * 2 * speed / CHORD}*Mq",
        Cmde=f"{moment}*Md",
    )
    print(f"\nqbar {qbar:.2f} psf, V {speed:.1f} ft/s\n{out['derived']}")
    out["collinearity"] = mf.collinearity([*shifted.values()], last)
    print(f"\n{out['collinearity']}")
    if figures:
        draw(out["fits"]["018, alpha earlier"], shifted, figures)
    return out


def draw(fit: mf.Fit, runs: dict[str, mf.Record], figures: common.Place) -> None:
    """Run 018, fitted, and run 019, predicted."""
    figure, axes = common.panels(2, 2, sharex="col", sharey="row")
    for column, (run, rec) in zip(axes.T, runs.items(), strict=True):
        ax = column[0]
        ax.set_title(f"run {run}, {'fitted' if run == '018' else 'predicted'}", fontsize=10)
        column[1].set_xlabel("t, s")
        for ax, name, y, own in zip(column, ("α, deg", "q, deg/s"), rec.y, fit.predict(rec).y, strict=True):
            ax.plot(rec.t, y, color="0.6", lw=2.5, label="measured")
            ax.plot(rec.t, own, color="C0", lw=1, label="model")
            ax.plot(rec.t, y - own, color="C3", lw=0.8, label="error")
            ax.grid(alpha=0.3)
            if run == "018":
                ax.set_ylabel(name)
    axes[0, 1].legend(fontsize=8)
    common.save(figure, "twin_otter", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
