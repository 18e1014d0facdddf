"""What fits of equations reach: the studies of docs/nonlinear.md, a table each.

Usage: python benches/nonlinear.py [study ...] [--replicates 2000] [--figures DIRECTORY]
"""

import argparse
import warnings
from pathlib import Path

import modfun as mf
import numpy as np
from fit_studies import Study, response, table
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import t as student
from weak_form import weak

# ---------------------------------------------------------------- Duffing


def duffing_input(t):
    return 2 * np.sin(1.1 * t) + 1.5 * np.sin(2.3 * t + 1) + np.sin(0.45 * t)


DUFFING = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
DUFFING_TRUE = {"d": 0.3, "a": 1.0, "b": 0.5}


def duffing_record(intervals=1024):
    """(y (1, N+1), u (1, N+1), dt) of THEORY's example, free of noise."""
    t = np.linspace(0, 20, intervals + 1)
    y = response(
        lambda s, x: [x[1], duffing_input(s) - 0.3 * x[1] - x[0] - 0.5 * x[0] ** 3],
        [0.5, 0.0],
        20.0,
        intervals,
    )[:1]
    return y, duffing_input(t)[None], 20 / intervals


def duffing(replicates, figures=None):
    """y'' + .3 y' + y + .5 y³ = u, 20 s, N = 1024: bias with and without correction."""
    y, u, dt = duffing_record()
    table("NSR, lines, signals")
    for nsr in (0.1, 0.3):
        for harmonics in (13, None):
            for correct in (True, False):
                found = Study(
                    DUFFING,
                    DUFFING_TRUE,
                    y,
                    dt,
                    nsr * np.sqrt(np.mean(y**2)),
                    (["y"], ["u"]),
                    replicates,
                    u,
                    harmonics=harmonics,
                    correct=correct,
                )
                word = "corrected" if correct else "raw"
                lines = "given" if harmonics else "default"
                print(f"| {nsr:g}, {lines}, {word} | {found.cells()} |", flush=True)


# ---------------------------------------------------------------- short period of an aircraft

SHORT = {"Za": -0.8, "Zd": -0.1, "Ma": -4.0, "Mq": -1.2, "Md": -5.0}


def elevator(t):
    """3-2-1-1 of .7 s, .05 rad, edges of .1 s, from t = 1 s."""
    edges = 1.0 + 0.7 * np.array([0, 3, 5, 6, 7])
    signs = 0.05 * np.array([1, -2, 2, -2, 1])
    return np.sum(signs * 0.5 * (1 + np.tanh((np.asarray(t)[..., None] - edges) / 0.05)), axis=-1)


def aircraft(**options):
    """The state equations with α and q measured."""
    return mf.StateSpace(
        [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"], **options
    )


def short_period_states(p, x0, t):
    """α and q (2, N+1) for parameters in SHORT's order, input straight over quarters of a sample."""
    za, zd, ma, mq, md = p
    roots, modes = np.linalg.eig(np.array([[za, 1], [ma, mq]]))
    fine = np.linspace(t[0], t[-1], 4 * (t.size - 1) + 1)
    u, h = elevator(fine), fine[1] - fine[0]
    states = 0.0
    for root, mode, b, start in zip(
        roots, modes.T, np.linalg.solve(modes, [zd, md]), np.linalg.solve(modes, x0), strict=True
    ):
        x = root * h
        first, second = np.expm1(x) / x, (np.expm1(x) - x) / x**2
        drive = h * b * ((first - second) * u[:-1] + second * u[1:])
        own = lfilter([1], [1, -np.exp(x)], np.concatenate([[start], drive]))
        states = states + np.outer(mode, own[::4])
    return states.real


def output_error(model, start, y, sigma):
    """SciPy's least squares on the states of `model(unknowns)`, weighted by σ: rows of unknowns."""
    out = []
    scale = np.maximum(np.abs(start), 0.01)
    for own in y:
        found = least_squares(
            lambda x, own=own: ((model(x * scale) - own) / sigma[:, None]).ravel(), start / scale, method="lm"
        )
        out.append(found.x * scale)
    return np.array(out)


def aircraft_record():
    """(times, true parameters, initial state, noise-free α and q)."""
    t, true, x0 = np.linspace(0, 12, 601), np.array(list(SHORT.values())), np.array([0.02, 0.0])
    return t, true, x0, short_period_states(true, x0, t)


def short_period(replicates, figures=None):
    """α' = Zα α + q + Zδ δ, q' = Mα α + Mq q + Mδ δ; NSR .1; output error on the first 500 records."""
    t, true, x0, clean = aircraft_record()
    sigma = 0.1 * np.sqrt(np.mean(clean**2, axis=1))
    names, u = (["alpha", "q"], ["de"]), elevator(t)
    table("lines")
    given = Study(aircraft(), SHORT, clean, t[1], sigma, names, replicates, u, harmonics=20, trend=None)
    print(f"| given | {given.cells()} |", flush=True)
    found = Study(aircraft(), SHORT, clean, t[1], sigma, names, replicates, u, trend=None)
    print(f"| default | {found.cells()} |", flush=True)
    rng = np.random.default_rng(1)
    y = [found.record(rng).y for _ in range(min(replicates, 500))]
    start = np.concatenate([true, x0])
    other = output_error(lambda x: short_period_states(x[:5], x[5:], t), start, y, sigma)
    order = [list(SHORT).index(name) for name in found.param_names]
    print(f"\nsd of each over that of output error with free initial state, the same {len(y)} records:")
    for word, own in (("given", given), ("default", found)):
        ratio = own.params[: len(y)].std(axis=0, ddof=1) / other[:, order].std(axis=0, ddof=1)
        parts = ", ".join(f"{n} {r:.3f}" for n, r in zip(found.param_names, ratio, strict=True))
        print(f"{word}: {parts}", flush=True)


def dropping(replicates, figures=None):
    """Root mean square errors in %, rms over the parameters: α and q, or q alone; Zδ known, NSR of q .05."""
    t, _, _, clean = aircraft_record()
    rms, u = np.sqrt(np.mean(clean**2, axis=1)), elevator(t)
    # q alone tells four of five, and Za by a quadratic equation: its other root is near -50.
    both = aircraft(params={"Zd": SHORT["Zd"], "Za": mf.Free(-1.0, min=-5.0, max=5.0)})
    print(f"{aircraft().without('alpha').identifiable()}\n")

    def error(model, kept, sigma, names, method):
        study = Study(
            model, SHORT, clean[kept], t[1], sigma, (names, ["de"]), replicates, u, trend=None, method=method
        )
        bias, _, sd = study.relative()
        return f"{np.hypot(bias, sd):.2f} ({bias:.2f})"

    alone = [error(both.without("alpha"), [1], 0.05 * rms[1], ["q"], method) for method in ("ml", "ls")]
    print(f"q alone: ml {alone[0]}, ls {alone[1]}; in brackets the bias\n")
    table("noise on α over its rms", "ml | ls |")
    for nsr in (0.01, 0.03, 0.1, 0.3, 1.0, 3.0):
        sigma = np.array([nsr, 0.05]) * rms
        cells = [error(both, [0, 1], sigma, ["alpha", "q"], method) for method in ("ml", "ls")]
        print(f"| {nsr:g} | {' | '.join(cells)} |", flush=True)


# ---------------------------------------------------------------- prey only


PREY = mf.Equation(["x' = a*x - x*z", "z' = d*x*z - c*z"], outputs=["x"])
PREY_TRUE = {"a": 3.0, "c": 6.0, "d": 1.0}


def prey_record():
    """(x (1, N+1), dt) of the prey of weak_form's Lotka–Volterra, free of noise; 5 s, N = 512."""
    a, c, d = PREY_TRUE.values()
    states = response(lambda t, v: [a * v[0] - v[0] * v[1], d * v[0] * v[1] - c * v[1]], [1.0, 1.0], 5.0, 512)
    return states[:1], 5 / 512


def prey(replicates, figures=None):
    """Lotka–Volterra of weak_form with the prey alone counted, log-normal noise."""
    clean, dt = prey_record()
    print(f"prey from {clean.min():.2f} to {clean.max():.1f}\n")
    table("noise of log prey")
    for sigma in (0.02, 0.05, 0.1, 0.2):
        found = Study(
            PREY,
            PREY_TRUE,
            clean,
            dt,
            sigma,
            (["x"], None),
            replicates,
            log=True,
            noise="log-normal",
        )
        print(f"| {sigma:g} | {found.cells()} |", flush=True)


# ---------------------------------------------------------------- parabolic damping


def parabolic(replicates, figures=None):
    """y'' + (c0 + c1 t + c2 t²) y' + k y = b u, NSR .05 and .2: the damping and its pointwise band."""
    truth = {"c0": 2.0, "c1": -0.6, "c2": 0.06, "k": 4.0, "b": 3.0}
    model = mf.Equation("y'' + c(t)*y' + k*y = b*u", varying={"c": ["1", "t", "t**2"]})
    t = np.linspace(0, 10, 513)

    def u(s):
        return np.sin(s**2 / 4) + 0.5 * np.sin(1.3 * s)

    def damping(s):
        return truth["c0"] + truth["c1"] * s + truth["c2"] * s**2

    y = response(lambda s, x: [x[1], 3 * u(s) - damping(s) * x[1] - 4 * x[0]], [0.3, 0.0], 10.0, 512)[:1]
    rms = np.sqrt(np.mean(y**2))
    table("NSR")
    for nsr in (0.05, 0.2):
        found = Study(model, truth, y, t[1], nsr * rms, (["y"], ["u"]), replicates, u(t))
        print(f"| {nsr:g} | {found.cells()} |", flush=True)
    count, at = min(replicates, 1000), damping(t)
    print(f"\nPointwise 95 % band of c(t), NSR .05, {count} records, over t:")
    for cov_type in ("HC3", "nonrobust"):
        rng = np.random.default_rng(2)
        inside = np.zeros(t.size)
        for _ in range(count):
            noisy = y + 0.05 * rms * rng.standard_normal(y.shape)
            fit = mf.fit(mf.Record(y=noisy, u=u(t), dt=t[1]), model, cov_type=cov_type)
            value, bse = fit.varying("c", t)
            half = student.ppf(0.975, fit.df_resid) * bse
            inside += 100 / count * (np.abs(value - at) <= half)
        error = 100 * np.sqrt(0.05 * 0.95 / count)
        print(
            f"{cov_type} covers {inside.mean():.1f} ({inside.min():.1f}–{inside.max():.1f}) ± {error:.1f} %"
        )
    if figures:
        draw_damping(t, at, value, half, figures)


def draw_damping(t, true, value, half, figures):
    """One record's damping coefficient with its band."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    fig, axis = plt.subplots(figsize=(7, 3.6), layout="constrained")
    axis.fill_between(t, value - half, value + half, alpha=0.25, lw=0, label="95 % band")
    axis.plot(t, value, label="estimate")
    axis.plot(t, true, "k--", label="true")
    axis.set(
        xlabel="time (s)", ylabel="damping c(t) (1/s)", title="Parabolic damping from one record, NSR .05"
    )
    axis.legend()
    fig.savefig(Path(figures) / "damping.png", dpi=130)


STUDIES = {
    "duffing": duffing,
    "short-period": short_period,
    "dropping": dropping,
    "prey": prey,
    "parabolic": parabolic,
    "weak": weak,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="*", default=list(STUDIES), metavar="study", help=", ".join(STUDIES))
    parser.add_argument("--replicates", type=int, default=2000)
    parser.add_argument("--figures", help="directory for figures")
    given = parser.parse_args()
    warnings.simplefilter("ignore", mf.ModfunWarning)
    for name in given.studies:
        own = STUDIES[name]
        print(f"\n## {name}, {given.replicates} records\n\n{own.__doc__}\n", flush=True)
        own(given.replicates, given.figures)


if __name__ == "__main__":
    main()
