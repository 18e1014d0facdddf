"""Systems with time lag: every table of docs/timelag.md, and its figures with --figures FOLDER.

Usage: python benches/timelag.py [roots order safe identify speed] [--replicates 300] [--figures docs/figures]
"""

import argparse
import sys
import time
import warnings
from pathlib import Path

import modfun as mf
import numpy as np
from fit_studies import HEAD, Study, table
from scipy.linalg import expm
from scipy.special import lambertw

sys.path.append(str(Path(__file__).parents[1] / "examples"))

import time_lag
from modfun.timelag.motion import Motion, history

DelaySystem = mf.timelag.DelaySystem


def axes(rows=1, columns=1, size=(7, 3.6), **words):
    """A figure that draws to files."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    return plt.subplots(rows, columns, figsize=size, layout="constrained", **words)


# ---------------------------------------------------------------- roots


def roots(replicates, figures=None):
    """Largest error and residual of the rightmost roots; time on one thread."""
    table("system", "roots | largest error | largest residual | counted | ms |")
    for a0, a1, h in ((0.5, -2.0, 0.7), (-1.0, 0.6, 2.0), (0.0, -3.0, 1.0)):
        for count in (20, 100):
            start = time.perf_counter()
            found = DelaySystem(A={0: a0, h: a1}).poles(count)
            spent = time.perf_counter() - start
            true = np.array([a0 + lambertw(a1 * h * np.exp(-a0 * h), k) / h for k in range(-120, 120)])
            error = np.abs(found.values[:, None] - true).min(axis=1) / np.abs(found.values)
            print(
                f"| x' = {a0:g} x + {a1:g} x(t − {h:g}), Lambert | {len(found)} | {error.max():.0e} | "
                f"{found.residual.max():.0e} | {found.counted} | {1e3 * spent:.0f} |"
            )
    rng = np.random.default_rng(1)
    for n in (2, 5, 10, 20):
        a = {h: rng.standard_normal((n, n)) for h in (0.0, 0.3, 0.77, 2.1)}
        start = time.perf_counter()
        found = DelaySystem(A=a).poles(20)
        spent = time.perf_counter() - start
        print(
            f"| random, n = {n}, lags .3, .77, 2.1 | {len(found)} | | {found.residual.max():.0e} | "
            f"{found.counted} | {1e3 * spent:.0f} |"
        )
    if figures:
        fig, axis = axes(size=(5.2, 4.2))
        plant = time_lag.plant()
        design = plant.place(time_lag.POLES)
        found = plant.poles(16)
        axis.plot(found.real, found.imag, "x", ms=8, mew=1.8, label="plant")
        axis.plot(design.poles().real, design.poles().imag, "o", mfc="none", ms=9, label="with u = −Kz")
        axis.axvline(0, color="0.3", lw=0.9)
        axis.axvline(found.line, color="0.5", ls=":", lw=1)
        axis.set(xlabel="real part (1/s)", ylabel="imaginary part (rad/s)", xlim=(-3.8, 0.6), ylim=(-50, 50))
        axis.legend()
        axis.grid(alpha=0.3)
        fig.savefig(Path(figures) / "timelag_roots.png", dpi=110)


# ---------------------------------------------------------------- order of the simulation


def order(replicates, figures=None):
    """Error at t = 6 s of a smooth response of x' = x/2 − 2x(t − 1), pieces of dt; order between rows."""
    plant = DelaySystem(A={0: 0.5, 1: -2.0})
    root = complex(plant.poles(4)[0])
    table("points", "error, pieces of .25 s | .125 s | .0625 s | order |")
    for stages in (2, 3, 4, 5, 7):
        errors = []
        for dt in (0.25, 0.125, 0.0625):
            past = history(lambda t: np.exp(root * t).real[None], 1, "history")
            motion = Motion(plant, dt, round(6 / dt), stages)
            pieces, _ = motion.run(past, np.ones(1), lambda t: np.zeros((0, t.size)), None, np.zeros((0, 0)))
            errors.append(abs(pieces[-1, -1, 0] - np.exp(6 * root).real))
        rate = np.log2(errors[0] / errors[1])
        print(f"| {stages} | " + " | ".join(f"{e:.1e}" for e in errors) + f" | {rate:.1f} |")


# ---------------------------------------------------------------- the integral over u


def naive(design, lag, nodes):
    """u = −K(x + trapezoidal sum of past u), its own term solved for: what one writes first."""
    t = design.transformation
    age = np.linspace(0, lag, nodes + 1)
    weight = np.full(nodes + 1, lag / nodes)
    weight[[0, -1]] /= 2
    b = t.plant.B[lag]
    rows = [-design.K @ (w * expm(t.A * (s - lag)) @ b) for w, s in zip(weight, age, strict=True)]
    own = np.linalg.inv(np.eye(len(rows[0])) - rows[0])

    def law(now, state, held):
        past = held(now - age[1:])
        return own @ (
            -design.K @ state(now)[:, 0] + sum(r @ p for r, p in zip(rows[1:], past.T, strict=True))
        )

    return law


def growth(run):
    """Growth rate of the envelope of u over the second half, 1/s; None where it is below 1e-9 there."""
    half = run.t > run.t[-1] / 2
    third = run.t > 3 * run.t[-1] / 4
    early, late = np.abs(run.u[0, half & ~third]).max(), np.abs(run.u[0, third]).max()
    return None if late < 1e-9 else np.log(late / early) / (run.t[-1] / 4)


def safe(replicates, figures=None):
    """x' = x + u(t − 1), x = 1 before; u computed every dt, held between: growth of |u|, 1/s."""
    plant = DelaySystem(A={0: 1.0}, B={1.0: 1.0})
    table("root wanted", "dt, s | controller of modfun | sum of 8 values | 16 | 40 | a value every dt |")
    for pole in (-1.0, -3.0, -5.0):
        design = plant.place([pole])
        for dt in (0.025, 0.0125):
            cells = []
            for law in (design, *(naive(design, 1.0, n) for n in (8, 16, 40, round(1 / dt)))):
                run = plant.simulate(law, duration=16, dt=dt, history=[1.0])
                rate = growth(run)
                cells.append("settled" if rate is None or rate < 0 else f"**+{rate:.2f}**")
            print(f"| {pole:g} | {dt:g} | {' | '.join(cells)} |", flush=True)
    if figures:
        design = plant.place([-5.0])
        fig, (upper, lower) = axes(2, size=(7, 4.4), sharex=True)
        for law, word, style in (
            (naive(design, 1.0, 8), "sum of 8 values", "C3-"),
            (naive(design, 1.0, 16), "sum of 16 values", "C1-"),
            (design, "exact over the hold", "C0-"),
        ):
            run = plant.simulate(law, duration=6, dt=0.0125, history=[1.0])
            upper.plot(run.t, run.x[0], style, lw=1.2, label=word)
            lower.step(run.t, run.u[0], style, where="post", lw=0.8)
        upper.set(ylabel="x", title="x' = x + u(t − 1), u every .0125 s, root wanted at −5")
        upper.legend()
        lower.set(xlabel="time (s)", ylabel="u", ylim=(-70, 70))
        fig.savefig(Path(figures) / "timelag_safe.png", dpi=110)


# ---------------------------------------------------------------- identification


def identify(replicates, figures=None):
    """x' = A0 x + A1 x(t − 1) + B u(t − .4) from both states: 40 s, N = 1000; mf.fit with its defaults."""
    clean = time_lag.record(0.0)
    rms = np.sqrt(np.mean(clean.y**2, axis=1))
    table("lag, NSR", HEAD)
    found = None
    for lag in (1.0, "h"):
        for nsr in (0.05, 0.1):
            found = Study(
                time_lag.structure(lag),
                time_lag.TRUTH,
                clean.y,
                clean.dt,
                nsr * rms,
                (["x1", "x2"], ["u"]),
                replicates,
                clean.u,
            )
            word = "known" if lag == 1.0 else "estimated"
            print(f"| {word}, {nsr:g} | {found.cells()} |", flush=True)
    print(f"\nEach parameter, lag estimated, NSR .1, {len(found.params)} records:\n")
    table("parameter", "true | bias | ± | sd | HC3 covers, % | classical covers, % |")
    bias, sd = found.params.mean(axis=0) - found.truth, found.params.std(axis=0, ddof=1)
    for k, name in enumerate(found.param_names):
        covers = " | ".join(f"{100 * c[k]:.1f}" for c in found.inside)
        error = sd[k] / np.sqrt(len(found.params))
        print(f"| {name} | {found.truth[k]:g} | {bias[k]:+.4f} | {error:.4f} | {sd[k]:.4f} | {covers} |")
    if figures:
        draw_identified(figures)


def draw_identified(figures):
    """One record, and the loop that was designed on what it told."""
    rec, fit, *_, runs = time_lag.main()
    fig, (upper, lower) = axes(2, size=(7, 4.8))
    predicted = fit.predict(rec)
    for k, name in enumerate(rec.outputs):
        upper.plot(rec.t, rec.y[k], color="0.6", lw=1.5, label="measured" if k == 0 else None)
        upper.plot(predicted.t, predicted.y[k], f"C{k}", lw=1, label=f"{name}, fitted")
    upper.set(xlabel="time (s)", title="Identified from noisy states (NSR .05) …")
    upper.legend(loc="upper right", ncols=3, fontsize=8)
    for word, run, style in (("without feedback", runs[0], "0.6"), ("u = −Kz", runs[1], "C0")):
        lower.plot(run.t, run.x[0], color=style, lw=1.2, label=f"x1, {word}")
        lower.plot(run.t, run.x[1], color=style, lw=1.2, ls="--", label=f"x2, {word}")
    lower.set(
        xlabel="time (s)", title="… and controlled: the true plant under the feedback designed on the fit"
    )
    lower.legend(fontsize=8, ncols=2)
    fig.savefig(Path(figures) / "timelag_identified.png", dpi=110)


# ---------------------------------------------------------------- time


def speed(replicates, figures=None):
    """Milliseconds on one thread, the least of five."""
    plant = time_lag.plant()
    design = plant.place(time_lag.POLES)
    half = {0: 0.1 * np.abs(plant.A[0.0]), 1.0: 0.1 * np.abs(plant.A[1.0])}
    rec = time_lag.record(0.05)

    def least(call, times=5):
        out = []
        for _ in range(times):
            start = time.perf_counter()
            call()
            out.append(time.perf_counter() - start)
        return f"{1e3 * min(out):.1f}"

    table("what", "ms |")
    fresh = {"A": plant.A, "B": plant.B}
    for word, call in (
        ("20 roots, n = 2", lambda: DelaySystem(**fresh).poles(20)),
        ("transformation and placement", lambda: DelaySystem(**fresh).place(time_lag.POLES)),
        ("controller: made, dt = .02", lambda: design.controller(0.02)),
        ("open loop, 1000 intervals", lambda: plant.simulate(duration=20, dt=0.02, initial_state=[1, 1])),
        (
            "closed loop, 1000 intervals",
            lambda: plant.simulate(design, duration=20, dt=0.02, initial_state=[1, 1]),
        ),
        ("μ, 8 real errors", lambda: plant.mu(design, A=half)),
        ("fit, lag known, N = 1000", lambda: mf.fit(rec, time_lag.structure(1.0))),
        ("fit, lag estimated, N = 1000", lambda: mf.fit(rec, time_lag.structure("h"))),
    ):
        print(f"| {word} | {least(call)} |", flush=True)


STUDIES = {"roots": roots, "order": order, "safe": safe, "identify": identify, "speed": speed}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="*", default=list(STUDIES), metavar="study", help=", ".join(STUDIES))
    parser.add_argument("--replicates", type=int, default=300)
    parser.add_argument("--figures", help="directory for figures")
    given = parser.parse_args()
    warnings.simplefilter("ignore", mf.ModfunWarning)
    for name in given.studies:
        print(f"\n## {name}\n\n{STUDIES[name].__doc__}\n", flush=True)
        STUDIES[name](given.replicates, given.figures)


if __name__ == "__main__":
    main()
