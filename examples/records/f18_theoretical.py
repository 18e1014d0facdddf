"""A published linear model of the F/A-18 moved by the inputs of two flights, and identified again.

The study of the report's section 4.7 on a theoretical model. Longitudinal: an unstable aircraft in a loop,
identified from the stabilator itself; lateral: two inputs. How the fit falls as noise rises.

    MODFUN_DATA=folder python examples/records/f18_theoretical.py [--figures docs/figures]
"""

import json
import warnings

import modfun as mf
import numpy as np
from common import data, panels, run, save

REPLICATES = 20
LEVELS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)  # noise, standard deviation over that of the output
FEEDBACK = {"alpha": 0.8, "q": 0.3}  # stabilator, deg a deg and deg a deg/s
REPORT = {"longitudinal": (34.0, 41.0), "lateral": (16.0, 30.0)}  # dB
BANDS = {"longitudinal": 7.0, "lateral": 7.5}  # rad/s, what the default rule takes at 5 % noise


def signal_to_error(y, simulated):
    """dB a channel, about the mean of y."""
    return 20 * np.log10(np.std(y, axis=1) / np.sqrt(np.mean((y - simulated) ** 2, axis=1)))


def inputs(folder, name, channels):
    """Inputs of a flight without their trim, and their step."""
    rec = mf.read(data(name, folder), outputs=["alpha_deg"], inputs=channels)
    return [u - u.mean() for u in rec.u], rec.dt


def longitudinal(folder, matrices):
    """Response from rest of alpha (deg) and q (deg/s), the stabilator under feedback, the command."""
    (command,), dt = inputs(folder, "f18harv_lon_153b/f18harv_153b.csv", ["stab_deg"])
    a, b = np.array(matrices["A"]), np.array(matrices["B"])[:, :1]
    gain = np.array([[0.0, FEEDBACK["alpha"], FEEDBACK["q"], 0.0]])
    loop = mf.ss(a + b @ gain, b, np.vstack([np.eye(4)[1:3], gain]), [[0.0], [0.0], [1.0]])
    alpha, q, stabilator = loop.simulate(u=[command], dt=dt)
    clean = mf.Record(y=[alpha, q], u=stabilator, dt=dt, outputs=["alpha", "q"], inputs=["stab"])
    return clean, command


def lateral(folder, matrices):
    """Response from rest of beta (deg), p and r (deg/s) to aileron and rudder."""
    u, dt = inputs(folder, "f18harv_lat_342l/f18harv_342l.csv", ["ail_deg", "rdr_deg"])
    aircraft = mf.ss(matrices["A"], matrices["B"], np.eye(4)[:3], np.zeros((3, 2)))
    y = aircraft.simulate(u=u, dt=dt)
    return mf.Record(y=y, u=u, dt=dt, outputs=["beta", "p", "r"], inputs=["ail", "rdr"])


def noisy(clean, level, seed):
    """The record with white noise on its outputs, each in proportion to its own standard deviation."""
    noise = np.random.default_rng(seed).standard_normal(clean.y.shape)
    return clean.assign(
        **dict(zip(clean.outputs, clean.y + level * np.std(clean.y, 1)[:, None] * noise, strict=True))
    )


def in_the_loop(fit, command, dt):
    """Response from rest of an identified longitudinal model under the same feedback."""
    den, _ = fit.polynomials()
    nums = [fit.polynomials(i)[1][0] for i in range(2)]
    for num, gain in zip(nums, FEEDBACK.values(), strict=True):
        den = np.polysub(den, gain * num)
    return np.asarray(mf.tf([[num] for num in nums], den).simulate(u=[command], dt=dt))


def study(kind, clean, poles, level, command=None):
    """Median over the replicates of S/E a channel against the noise-free outputs, and of S/E in the loop."""
    estimator = mf.Estimator(mf.TransferFunction(poles=poles, denominator="common"), band=BANDS[kind])
    found = []
    for seed in range(REPLICATES if level else 1):
        rec = noisy(clean, level, seed)
        with warnings.catch_warnings():  # an unstable estimate is what we want; too high orders warn, too
            warnings.simplefilter("ignore", mf.ModfunWarning)
            fit = estimator(rec)
        ways = [lambda fit=fit, rec=rec: fit.predict(rec).y]
        if command is not None:
            ways.append(lambda fit=fit, rec=rec: in_the_loop(fit, command, rec.dt))
        found.append([_simulated(clean.y, way) for way in ways])
    return np.median(found, axis=0)


def _simulated(y, way):
    """S/E of a simulation; minus infinity of one that overflows."""
    try:
        return signal_to_error(y, way())
    except mf.DataError:
        return np.full(len(y), -np.inf)


def main(folder=None, figures=None):
    """Tables by order at 5 % noise and by noise at the right order, in dB; the figure."""
    matrices = json.loads(data("f18_polynomial_model/f18_poly_and_linear_5deg.json", folder).read_text())
    lon, command = longitudinal(folder, matrices["lon"])
    lat = lateral(folder, matrices["lat"])
    rows = []
    for poles in (2, 3, 4):
        own, loop = study("longitudinal", lon, poles, 0.05, command)
        other = study("lateral", lat, poles, 0.05)[0]
        rows.append([poles, *own, *loop, *other])
    names = ["poles", "alpha", "q", "alpha in the loop", "q in the loop", "beta", "p", "r"]
    orders = mf.Table(dict(zip(names, zip(*np.round(rows, 1), strict=True), strict=True)))
    print(f"S/E in dB, {100 * 0.05:g} % noise, median of {REPLICATES} replicates\n{orders}\n")

    rows = []
    for level in LEVELS:
        own, loop = study("longitudinal", lon, 2, level, command)
        rows.append([100 * level, *own, *loop, *study("lateral", lat, 4, level)[0]])
    names[0] = "noise, %"
    noise = mf.Table(dict(zip(names, zip(*np.round(rows, 1), strict=True), strict=True)))
    print(f"S/E in dB, longitudinal with 2 poles, lateral with 4, median of {REPLICATES} replicates\n{noise}")
    if figures is not None:
        draw(noise, figures)
    return {"orders": orders, "noise": noise, "longitudinal": lon, "command": command}


def draw(noise, figures):
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
