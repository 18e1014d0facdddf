"""A published linear model of the F/A-18 moved by the inputs of two flights, and identified again.

The study of the report's section 4.7 on a theoretical model. Longitudinal: an unstable aircraft in a loop,
identified from the stabilator itself; lateral: two inputs. How the fit falls as noise rises.

    MODFUN_DATA=folder python examples/records/f18_theoretical.py [--figures docs/figures]
"""

import json
from collections.abc import Callable
from typing import Any

import modfun as mf
import numpy as np
from common import Array, Place, data, panels, run, save

REPLICATES = 20
LEVELS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)  # noise, standard deviation over that of the output
FEEDBACK = {"alpha": 0.8, "q": 0.3}  # stabilator, deg a deg and deg a deg/s
REPORT = {"longitudinal": (34.0, 41.0), "lateral": (16.0, 30.0)}  # dB
BANDS = {"longitudinal": 7.0, "lateral": 7.5}  # rad/s, what the default rule takes at 5 % noise


def signal_to_error(y: Array, simulated: Array) -> Array:
    """dB a channel, about the mean of y."""
    level: Array = 20 * np.log10(np.std(y, axis=1) / np.sqrt(np.mean((y - simulated) ** 2, axis=1)))
    return level


def inputs(folder: Place, name: str, channels: list[str]) -> tuple[list[Array], float]:
    """Inputs of a flight without their trim, and their step."""
    rec = mf.read(data(name, folder), outputs=["alpha_deg"], inputs=channels)
    return [u - u.mean() for u in rec.u], float(rec.t[1] - rec.t[0])


def longitudinal(folder: Place, matrices: dict[str, Any]) -> tuple[mf.Record, Array]:
    """Response from rest of alpha (deg) and q (deg/s), the stabilator under feedback, the command."""
    (command,), dt = inputs(folder, "f18harv_lon_153b/f18harv_153b.csv", ["stab_deg"])
    a, b = np.array(matrices["A"]), np.array(matrices["B"])[:, :1]
    gain = np.array([[0.0, FEEDBACK["alpha"], FEEDBACK["q"], 0.0]])
    loop = mf.ss(a + b @ gain, b, np.vstack([np.eye(4)[1:3], gain]), [[0.0], [0.0], [1.0]])
    alpha, q, stabilator = loop.simulate(u=[command], dt=dt)
    clean = mf.Record(
        y=[alpha, q], u=stabilator, dt=dt, intersample="smooth", outputs=["alpha", "q"], inputs=["stab"]
    )
    return clean, command


def lateral(folder: Place, matrices: dict[str, Any]) -> mf.Record:
    """Response from rest of beta (deg), p and r (deg/s) to aileron and rudder."""
    u, dt = inputs(folder, "f18harv_lat_342l/f18harv_342l.csv", ["ail_deg", "rdr_deg"])
    aircraft = mf.ss(matrices["A"], matrices["B"], np.eye(4)[:3], np.zeros((3, 2)))
    y = aircraft.simulate(u=u, dt=dt)
    names = ["beta", "p", "r"]
    return mf.Record(y=y, u=u, dt=dt, intersample="smooth", outputs=names, inputs=["ail", "rdr"])


def noisy(clean: mf.Record, level: float, seed: int) -> mf.Record:
    """The record with white noise on its outputs, each in proportion to its own standard deviation."""
    noise = np.random.default_rng(seed).standard_normal(clean.y.shape)
    return clean.assign(
        **dict(zip(clean.outputs, clean.y + level * np.std(clean.y, 1)[:, None] * noise, strict=True))
    )


def in_the_loop(fit: mf.Fit, rec: mf.Record, command: Array) -> mf.Record:
    """Response from rest of an identified longitudinal model under the same feedback, as a record."""
    den: Array = fit.polynomials()[0]
    nums = [fit.polynomials(i)[1][0] for i in range(2)]
    for num, gain in zip(nums, FEEDBACK.values(), strict=True):
        den = np.asarray(np.polysub(den, gain * num), dtype=float)
    alpha, q = mf.tf([[num] for num in nums], den).simulate(u=[command], dt=rec.dt)
    return rec.assign(alpha=alpha, q=q)


def score(clean: mf.Record, predict: Callable[..., mf.Record], *given: Any) -> Array:
    """S/E of a simulation; minus infinity of one that overflows."""
    try:
        return signal_to_error(clean.y, predict(*given).y)
    except mf.DataError:
        return np.full(len(clean.y), -np.inf)


def study(kind: str, clean: mf.Record, poles: int, level: float, command: Array | None = None) -> Array:
    """Median over the replicates of S/E a channel against the noise-free outputs, and of S/E in the loop."""
    estimator = mf.Estimator(mf.TransferFunction(poles=poles, denominator="common"), band=BANDS[kind])
    found = []
    for seed in range(REPLICATES if level else 1):
        rec = noisy(clean, level, seed)
        fit = estimator(rec)
        found.append([score(clean, fit.predict, rec)])
        if command is not None:
            found[-1].append(score(clean, in_the_loop, fit, rec, command))
    middle: Array = np.median(found, axis=0)
    return middle


def poles_of(lon: mf.Record, lat: mf.Record, matrices: dict[str, Any]) -> mf.Table:
    """Table of the poles of a fit each, with their standard errors and the truth."""
    columns: dict[str, list[Any]] = {"model": [], "pole": [], "omega": [], "bse": [], "truth": []}
    for kind, clean, count in (("longitudinal", lon, 2), ("lateral", lat, 4)):
        structure = mf.TransferFunction(poles=count, denominator="common")
        fit = mf.Estimator(structure, band=BANDS[kind])(noisy(clean, 0.05, 0))
        true = np.array([complex(*pair) for pair in matrices[kind[:3]]["eig"]])
        for row in fit.damp():
            nearest = true[np.argmin(np.abs(true - row["pole"]))]
            for name, value in zip(
                columns, (kind, row["pole"], row["omega"], row["omega_bse"], abs(nearest)), strict=True
            ):
                columns[name].append(value)
    return mf.Table(columns)


def main(folder: Place = None, figures: Place = None) -> dict[str, Any]:
    """Tables by order at 5 % noise and by noise at the right order, in dB; the figure."""
    matrices = json.loads(data("f18_polynomial_model/f18_poly_and_linear_5deg.json", folder).read_text())
    lon, command = longitudinal(folder, matrices["lon"])
    lat = lateral(folder, matrices["lat"])
    estimates = poles_of(lon, lat, matrices)
    print(f"Poles, rad/s, 5 % noise, one record; longitudinal of 2, lateral of 4\n{estimates}\n")
    names = ["alpha", "q", "alpha in the loop", "q in the loop", "beta", "p", "r"]

    def table(first: str, cases: list[tuple[float, tuple[int, int], float]]) -> mf.Table:
        rows = []
        for value, poles, level in cases:
            flown = study("longitudinal", lon, poles[0], level, command)
            rows.append([value, *flown.ravel(), *study("lateral", lat, poles[1], level).ravel()])
        return mf.Table(dict(zip([first, *names], np.round(rows, 1).T, strict=True)))

    orders = table("poles", [(n, (n, n), 0.05) for n in (2, 3, 4)])
    print(f"S/E in dB, 5 % noise, median of {REPLICATES} replicates\n{orders}\n")
    noise = table("noise, %", [(100 * level, (2, 4), level) for level in LEVELS])
    print(f"S/E in dB, longitudinal with 2 poles, lateral with 4, median of {REPLICATES} replicates\n{noise}")
    if figures is not None:
        draw(noise, figures)
    return {"poles": estimates, "orders": orders, "noise": noise, "longitudinal": lon, "command": command}


def draw(noise: mf.Table, figures: Place) -> None:
    """S/E over noise, the report's ranges shaded."""
    figure, axes = panels(1, 2, sharey=True)
    shown = {
        "longitudinal": ["alpha", "q", "alpha in the loop", "q in the loop"],
        "lateral": ["beta", "p", "r"],
    }
    level = noise["noise, %"]
    for ax, (kind, channels) in zip(axes, shown.items(), strict=True):
        ax.axhspan(*REPORT[kind], color="0.85", label="the report's range")
        for k, channel in enumerate(channels):
            line = f"C{k % 2}{'--' if 'loop' in channel else '-'}" if kind == "longitudinal" else f"C{k}-"
            ax.plot(level[1:], noise[channel][1:], line, marker="o", markersize=4, label=channel)
        ax.plot(
            level[1:], -20 * np.log10(level[1:] / 100), color="0.4", linestyle=":", label="the noise itself"
        )
        ax.set_xscale("log")
        ax.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
        ax.minorticks_off()
        ax.set_xlabel("noise (% of each output)")
        ax.set_title(kind, fontsize="medium")
        ax.grid(True, alpha=0.3)
        ax.legend(fontsize="small")
    axes[0].set_ylabel("S/E against the noise-free output (dB)")
    save(figure, "f18_theoretical", figures)


if __name__ == "__main__":
    run(main, __doc__)
