"""Twin Otter, rudder 2-1-1 and aileron doublet: lateral derivatives and transfer functions.

Usage: python examples/records/twin_otter_lateral.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

from typing import Any

import common
import modfun as mf
import numpy as np

GRAVITY = 32.174  # ft/s2
WING, SPAN = 422.48, 64.99  # ft2, ft
MASS, IXX, IZZ, IXZ = 339.3, 20902.0, 38463.0, 1127.0  # slug, slug ft2: the READMEs of the records
CHANNELS = {"beta": "beta_deg", "p": "p_dps", "r": "r_dps", "phi": "phi_deg"}
KEPT = {"V": "V_fps", "qbar": "qbar_psf", "alpha": "alpha_deg", "theta": "theta_deg", "ay": "ay_g"}


def read(folder: common.Place = None) -> mf.Record:
    """Sideslip, bank angle (deg), roll and yaw rate (deg/s), aileron and rudder (deg), 50 Hz."""
    path = common.data("twinotter_lat_f1_017/twinotter_lat_f1_017.csv", folder)
    return mf.read(path, time="t_s", outputs=CHANNELS, inputs={"da": "ail_deg", "dr": "rdr_deg"}, keep=KEPT)


def structure(rec: mf.Record) -> mf.StateSpace:
    """Kinematics and gravity known from the trim of the record, aerodynamics unknown."""
    alpha, theta, speed = np.deg2rad(rec["alpha"].mean()), np.deg2rad(rec["theta"].mean()), rec["V"].mean()
    return mf.StateSpace(
        [
            ["Yb", np.sin(alpha), -np.cos(alpha), GRAVITY / speed * np.cos(theta)],
            ["Lb", "Lp", "Lr", 0],
            ["Nb", "Np", "Nr", 0],
            [0, 1, np.tan(theta), 0],
        ],
        [[0, "Ydr"], ["Lda", "Ldr"], ["Nda", "Ndr"], [0, 0]],
        states=["beta", "p", "r", "phi"],
        inputs=["da", "dr"],
    )


def lag(rec: mf.Record) -> tuple[float, float]:
    """Lag of beta (s) behind what gyroscopes and accelerometer say of it, with their agreement (dB).

    beta' = p sin alpha - r cos alpha + g/V (ay + cos theta sin phi), which holds whatever the aerodynamics.
    """
    alpha, theta, phi = (np.deg2rad(rec[name]) for name in ("alpha", "theta", "phi"))
    force = np.rad2deg(GRAVITY / rec["V"] * (rec["ay"] + np.cos(theta) * np.sin(phi)))
    return common.lag(rec, "beta", rec["p"] * np.sin(alpha) - rec["r"] * np.cos(alpha) + force)


def nondimensional(fit: mf.Fit, rec: mf.Record) -> mf.Table:
    """Coefficients of force and moments a radian; rates count as p b/2V."""
    pressure, speed = rec["qbar"].mean() * WING, rec["V"].mean()
    moment, turn = pressure * SPAN, 2 * speed / SPAN
    found = {"CYb": f"{MASS * speed / pressure}*Yb", "CYdr": f"{MASS * speed / pressure}*Ydr"}
    for name, scale in {"b": 1.0, "p": turn, "r": turn, "da": 1.0, "dr": 1.0}.items():
        found[f"Cl{name}"] = f"{scale / moment}*({IXX}*L{name} - {IXZ}*N{name})"
        found[f"Cn{name}"] = f"{scale / moment}*({IZZ}*N{name} - {IXZ}*L{name})"
    return fit.derived(**found)


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit, print; returns what the page states."""
    rec = read(folder)
    out: dict[str, Any] = {"lag": lag(rec)}
    late, level = out["lag"]
    print(f"The vane follows the integrated rates by {1000 * late:.0f} ms: agreement {level:.1f} dB")

    model, moved = structure(rec), common.earlier(rec, "beta")
    part = moved.window(2.5, 15.0)
    fits = {
        "as recorded": mf.fit(rec, model),
        "beta earlier": mf.fit(moved, model),
        "and 2.5 to 15 s": mf.fit(part, model),
    }
    out["fits"] = fits
    names = fits["as recorded"].param_names
    for some in (names[:6], names[6:]):
        print(f"\n{common.estimates(fits, some)}")
    levels = {name: fit.score()["signal_to_error"] for name, fit in fits.items()}

    shared = mf.TransferFunction(poles=4, denominator="common")
    out["tf"] = mf.fit(rec.select(outputs=["beta", "p", "r"]), shared)
    levels["transfer functions"] = np.append(out["tf"].score()["signal_to_error"], np.nan)
    out["levels"] = levels
    columns: dict[str, Any] = {
        c: np.round([row[i] for row in levels.values()], 1) for i, c in enumerate(CHANNELS)
    }
    print(f"\nS/E, dB\n{mf.Table({'fit': list(levels)} | columns)}")

    last = fits["and 2.5 to 15 s"]
    print(f"\nState equations, beta earlier, 2.5 to 15 s\n{last.table()}\n\n{last.damp()}")
    print(f"\nTransfer functions, four common poles\n{out['tf'].damp()}")
    out["derived"] = nondimensional(last, rec)
    print(f"\n{out['derived']}")
    out["collinearity"] = mf.collinearity(part, last)
    print(f"\n{out['collinearity']}")
    if figures:
        draw(last, part, figures)
    return out


def draw(fit: mf.Fit, rec: mf.Record, figures: common.Place) -> None:
    """All four channels, measured and simulated."""
    figure, axes = common.panels(2, 2, sharex=True)
    labels = ("β, deg", "p, deg/s", "r, deg/s", "φ, deg")
    for ax, name, y, own in zip(axes.flat, labels, rec.y, fit.predict(rec).y, strict=True):
        ax.plot(rec.t, y, color="0.6", lw=2.5, label="measured")
        ax.plot(rec.t, own, color="C0", lw=1, label="model")
        ax.plot(rec.t, y - own, color="C3", lw=0.8, label="error")
        ax.set_ylabel(name)
        ax.grid(alpha=0.3)
    for ax in axes[1]:
        ax.set_xlabel("t, s")
    axes[0, 0].legend(fontsize=8)
    common.save(figure, "twin_otter_lateral", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
