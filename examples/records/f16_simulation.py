"""F-16, nonlinear simulation of an aileron sweep: state equations against its linear model.

Usage: python examples/records/f16_simulation.py [FOLDER, default $MODFUN_DATA] [--figures docs/figures]
"""

import json
from typing import Any

import common
import modfun as mf
import numpy as np

GRAVITY = 32.174  # ft/s2
CHANNELS = {"beta": "beta_deg", "p": "p_dps", "r": "r_dps", "phi": "phi_deg"}
KEPT = {"alpha": "alpha_deg", "V": "V_fps"}
NAMES = ("Yb", "Yp", "Yr", "Yphi", "Lb", "Lp", "Lr", "Nb", "Np", "Nr", "Pr", "Yda", "Lda", "Nda")
REPLICATES = 100


def read(folder: common.Place = None, intersample: str = "smooth") -> mf.Record:
    """Sideslip, bank angle (deg), roll and yaw rate (deg/s), aileron (deg), 40 Hz, 15 s."""
    path = common.data("f16sim_lat_schroeder/f16sim_lat.csv", folder)
    inputs = {"da": "ail_deg"}
    return mf.read(path, time="t_s", outputs=CHANNELS, inputs=inputs, keep=KEPT, intersample=intersample)


def published(folder: common.Place = None) -> tuple[common.Array, common.Array, common.Array]:
    """Finite-difference matrices A and B (aileron, all in degrees), and their entries by name."""
    given = json.loads(common.data("f16sim_lat_schroeder/linear_model_AB.json", folder).read_text())
    a, b = np.array(given["A"]), np.degrees(np.array(given["B"])[:, :1])
    entries = [*a[0], *a[1, :3], *a[2, :3], a[3, 2], *b[:3, 0]]
    return a, b, np.array(entries)


def structure(**held: float) -> mf.StateSpace:
    """Every entry that need not be 0 or 1 is a parameter."""
    return mf.StateSpace(
        [["Yb", "Yp", "Yr", "Yphi"], ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, "Pr", 0]],
        ["Yda", "Lda", "Nda", 0],
        states=["beta", "p", "r", "phi"],
        inputs=["da"],
        params=held,
    )


def known(rec: mf.Record) -> dict[str, float]:
    """What no aerodynamics enters: gravity in beta', and yaw rate in phi', from the trimmed flight."""
    alpha, speed = np.deg2rad(rec["alpha"][0]), rec["V"][0]
    return {"Yphi": GRAVITY / speed * np.cos(alpha), "Pr": np.tan(alpha)}


def simulated(a: common.Array, b: common.Array, rec: mf.Record) -> tuple[common.Array, common.Array]:
    """S/E (dB) and errors of matrices against the record."""
    own = mf.ss(a, b, np.eye(4)).simulate(u=rec["da"], dt=rec.dt, intersample=rec.intersample[0])
    error = rec.y - own
    error -= error.mean(axis=1, keepdims=True)
    return 20 * np.log10(rec.y.std(axis=1) / error.std(axis=1)), error


def covered(
    a: common.Array, b: common.Array, truth: common.Array, rec: mf.Record, fit: mf.Fit
) -> common.Array:
    """In how many simulations of the matrices, with the fit's errors as noise, 3 errors hold the truth, %."""
    own = mf.ss(a, b, np.eye(4)).simulate(u=rec["da"], dt=rec.dt)
    size = fit.errors().std(axis=1)[:, None]
    noise = [np.random.default_rng([3, k]).standard_normal(own.shape) for k in range(REPLICATES)]
    batch = mf.Batch(
        y=own + size * np.array(noise), u=rec.u[None], dt=rec.dt, outputs=rec.outputs, inputs=["da"]
    )
    many = mf.fit_many(batch, fit.structure, noise=mf.Noise(y=size[:, 0]), band=fit.band)
    kept = [NAMES.index(name) for name in fit.param_names]
    share: common.Array = 100 * np.mean(np.abs(many.params - truth[kept]) < 3 * many.bse, axis=0)
    return share


def main(folder: common.Place = None, figures: common.Place = None) -> dict[str, Any]:
    """Fit, compare, print; returns what the page states."""
    rec, (a, b, truth) = read(folder), published(folder)
    print(f"Noise of the high band\n{rec.noise_level()}")
    speed, alpha = rec["V"], rec["alpha"]
    print(f"V {speed[0]:.1f} to {speed[-1]:.1f} ft/s, alpha within {np.ptp(alpha):.3f} deg")

    more = b.copy()
    more[2] *= 1.009
    cases = {f"published, {word}": (a, b, read(folder, word)) for word in ("smooth", "foh", "zoh")}
    cases["published, Nda 0.9 % larger"] = a, more, rec
    found = {name: simulated(*case) for name, case in cases.items()}
    fits = {"all": mf.fit(rec, structure()), "two known": mf.fit(rec, structure(**known(rec)))}
    levels = {name: level for name, (level, _) in found.items()}
    levels |= {f"fit, {name}": fit.score()["signal_to_error"] for name, fit in fits.items()}
    columns: dict[str, Any] = {
        c: np.round([row[i] for row in levels.values()], 1) for i, c in enumerate(CHANNELS)
    }
    print(f"\n{mf.Table({'S/E, dB': list(levels)} | columns)}")

    off, shares = {}, {}
    for name, fit in fits.items():
        kept = [NAMES.index(one) for one in fit.param_names]
        off[name] = dict(zip(fit.param_names, (fit.params - truth[kept]) / fit.bse, strict=True))
        rows: dict[str, Any] = {
            "parameter": fit.param_names,
            "published": truth[kept].round(5),
            "estimate": fit.params,
        }
        rows |= {"se": fit.bse, "off, errors": np.round(list(off[name].values()), 1)}
        rows["simulated, %"] = shares[name] = covered(a, b, truth, rec, fit)
        print(f"\n{mf.Table(rows, name)}")
    out: dict[str, Any] = {"truth": truth, "levels": levels, "fits": fits, "off": off, "covered": shares}
    out["collinearity"] = {name: mf.collinearity(rec, fits[name]) for name in fits}
    for name, shown in out["collinearity"].items():
        print(f"\n{name}\n{shown}")
    if figures:
        draw(rec, found, fits["all"], off, figures)
    return out


def draw(
    rec: mf.Record, found: dict[str, Any], fit: mf.Fit, off: dict[str, Any], figures: common.Place
) -> None:
    """Errors of the yaw rate, and how far estimates lie from the published entries."""
    figure, (left, right) = common.panels(1, 2, size=(9.0, 3.8))
    left.plot(rec.t, found["published, smooth"][1][2], label="published matrices")
    left.plot(rec.t, found["published, Nda 0.9 % larger"][1][2], label="with Nδa 0.9 % larger")
    left.plot(rec.t, fit.errors()[2], label="fit")
    left.set(xlabel="t, s", ylabel="error of r, deg/s")
    for shift, name in ((-0.12, "all"), (0.12, "two known")):
        at = [NAMES.index(one) + shift for one in off[name]]
        right.plot(at, list(off[name].values()), "o", ms=5, label=name)
    right.axhspan(-3, 3, color="0.9")
    right.set_xticks(range(len(NAMES)), NAMES, rotation=60)
    right.set_ylabel("estimate − published, standard errors")
    for ax in (left, right):
        ax.legend(fontsize=8)
        ax.grid(alpha=0.3)
    common.save(figure, "f16_simulation", figures)


if __name__ == "__main__":
    common.run(main, __doc__)
