"""Orders of convergence, measured beside those of theory, with docs/figures/validation_orders.png."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import modfun as mf
import numpy as np
from page import Section
from scipy.integrate import quad

FIGURE = Path(__file__).resolve().parents[2] / "docs" / "figures" / "validation_orders.png"
SYSTEM, INPUT, TRUE = mf.tf([5], [1, 3, 8]), "sin(t**2/5)", np.array([3.0, 8.0, 5.0])
TF2 = mf.TransferFunction(poles=2, zeros=0)
RULES = {"staircase": 1, "trapezoid": 2, "parabolic": 4, "gregory": 5}
DUFFING = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
NEAR = 0.25  # of an order: what errors of higher order may add to a slope over finite steps

REASONS: dict[str, str] = {}


@dataclass(frozen=True)
class Curve:
    """Errors over steps; `slope` is what theory says, `error` the Monte Carlo errors of the logarithms."""

    panel: str
    name: str
    x: np.ndarray
    y: np.ndarray
    theory: float
    error: np.ndarray | None = None
    most: float | None = None  # where theory gives a range

    @property
    def said(self) -> str:
        return f"{self.theory:g}" if self.most is None else f"{self.theory:g} to {self.most:g}"

    def fitted(self) -> tuple[float, float]:
        """Slope in log-log and its standard error."""
        lx = np.log(self.x) - np.mean(np.log(self.x))
        weight = np.ones(lx.size) if self.error is None else 1 / self.error**2
        lx = lx - np.average(lx, weights=weight)
        slope = float(np.sum(weight * lx * np.log(self.y)) / np.sum(weight * lx**2))
        return slope, 0.0 if self.error is None else float(1 / np.sqrt(np.sum(weight * lx**2)))


def _rms(theta: np.ndarray) -> float:
    return float(np.sqrt(np.mean((theta / TRUE - 1) ** 2)))


# Samples, holds ----------------------------------------------------------------------------------


def quadrature() -> list[Curve]:
    """V(m) of a function that is not periodic, m = 3, and θ of `ls` without noise."""

    def v(t: np.ndarray) -> np.ndarray:
        return np.exp(-0.7 * t) * np.cos(2 * t) + 0.3 * t

    period, m = 2.0, 3
    turn = 2 * np.pi * m / period
    exact = complex(
        quad(lambda t: v(t) * np.cos(turn * t), 0, period, epsabs=1e-14, limit=200)[0] / period,
        -quad(lambda t: v(t) * np.sin(turn * t), 0, period, epsabs=1e-14, limit=200)[0] / period,
    )
    out = []
    for rule, order in RULES.items():
        counts = np.array([64, 128, 256, 512])
        errors = []
        for n in counts:
            rec = mf.Record(y=v(np.linspace(0, period, n + 1)), dt=period / n)
            errors.append(abs(mf.coefficients(rec, 4, rule).y[0, m] - exact))
        out.append(Curve("coefficient", rule, period / counts, np.array(errors), order))
    for rule, order in RULES.items():
        counts = np.array([512, 1024, 2048] if rule == "gregory" else [256, 512, 1024])
        errors = []
        for n in counts:
            rec = mf.simulate(SYSTEM, input=INPUT, duration=10.0, intervals=int(n), initial_state=[1.0, 0.5])
            errors.append(_rms(mf.fit(rec, TF2, method="ls", rule=rule, harmonics=6, trend=None).params))
        out.append(Curve("estimate", f"ls, {rule}", 10 / counts, np.array(errors), order))
    return out


def holds() -> list[Curve]:
    """Responses to sin(t²/5) sampled and held, joined by lines, or by splines, against the exact one."""
    counts = np.array([128, 256, 512, 1024])
    out = []
    for name, order in (("zoh", 1), ("foh", 2), ("smooth", 4)):
        errors = []
        for n in counts:
            t = np.linspace(0, 10, n + 1)
            exact = mf.simulate(SYSTEM, input=INPUT, duration=10.0, intervals=int(n)).y[0]
            held = SYSTEM.simulate(u=np.sin(t**2 / 5), dt=10 / n, intersample=name)
            errors.append(np.sqrt(np.mean((held - exact) ** 2) / np.mean(exact**2)))
        out.append(Curve("hold", f"samples, {name}", 10 / counts, np.array(errors), order))
    errors, counts = [], np.array([128, 256, 512])
    for n in counts:
        u = np.repeat(np.sign(np.sin(2.7 * np.arange(32) ** 2)), n // 32)
        u = np.append(u, u[-1])
        rec = mf.simulate(SYSTEM, input=u, duration=10.0, intervals=int(n), intersample="zoh")
        smooth = mf.Record(y=rec.y, u=rec.u, dt=rec.dt, intersample="smooth")
        errors.append(_rms(mf.fit(smooth, TF2, method="ml", harmonics=6, trend=None).params))
    out.append(Curve("hold", "ml, held input called smooth", 10 / counts, np.array(errors), 1))
    return out


def integration() -> list[Curve]:
    """The Duffing oscillator against itself at rtol 1e-12; a delay equation against an exact exponential."""
    from modfun.timelag.motion import Motion, history

    model = DUFFING.model({"d": 0.3, "a": 1.0, "b": 0.5})
    given = {
        "u": "sin(1.3*t)",
        "dt": 1.0,
        "intervals": 800,
        "initial_state": [0.5, 0.0],
    }  # long, so that steps are free
    exact = model.simulate(**given, rtol=1e-12)
    steps = np.array([1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
    errors = [np.max(np.abs(model.simulate(**given, rtol=r) - exact)) / np.max(np.abs(exact)) for r in steps]
    out = [Curve("integration", "Duffing, over the tolerance", steps, np.array(errors), 1)]
    plant = mf.timelag.DelaySystem(A={0: 0.5, 1: -2.0})
    root = complex(plant.poles(4)[0])
    past = history(lambda t: np.exp(root * t).real[None], 1, "history")
    for stages in (2, 3, 4):
        errors, steps = [], np.array([0.25, 0.125, 0.0625])
        for dt in steps:
            motion = Motion(plant, float(dt), round(6 / dt), stages)
            pieces, _ = motion.run(past, np.ones(1), lambda t: np.zeros((0, t.size)), None, np.zeros((0, 0)))
            errors.append(abs(pieces[-1, -1, 0] - np.exp(6 * root).real))
        curve = Curve("integration", f"delay, {stages} points", steps, np.array(errors), 2 * stages - 1)
        out.append(curve)
    return out


# Noise -------------------------------------------------------------------------------------------


def noise(replicates: int) -> list[Curve]:
    """Bias and scatter of the report's example, N = 256, M = 6, over the noise."""
    levels = np.array([0.025, 0.05, 0.1, 0.2])
    found = mf.MonteCarlo(
        system=SYSTEM, input=INPUT, duration=10.0, intervals=256, nsr=levels.tolist(), rule="gregory",
        estimators=["ls", "awls", "ml"], harmonics=6, trend=None, replicates=replicates, seed=21,
    ).run(threads=2, progress=False, coverage=False)  # fmt: skip
    out = []
    for k, name in enumerate(("ls", "awls", "ml")):
        bias, sd = found.bias[:, k] / TRUE, found.sd[:, k] / TRUE
        size = np.sqrt(np.mean(bias**2, axis=1))
        error = np.sqrt(np.mean((found.bias_mcse[:, k] / TRUE) ** 2, axis=1)) / size
        if name != "ml":  # of ml the bias is that of a curved model, a hundred times below the scatter
            out.append(Curve("bias", f"bias of {name}", levels, size, 2, error))
        spread = np.sqrt(np.mean(sd**2, axis=1))
        error = np.full(levels.size, 1 / np.sqrt(2 * replicates * 3))
        out.append(Curve("bias", f"sd of {name}", levels, spread, 1, error))
    return out


def duffing(replicates: int) -> list[Curve]:
    """Bias by y³ of a noisy y, signals as they are; one record's noise serves all levels."""
    from nonlinear import duffing_record

    y, u, dt = duffing_record(512)
    levels = np.array([0.1, 0.15, 0.2])
    rng = np.random.default_rng(22)
    normals = rng.standard_normal((replicates, 1, y.size))
    size, error = [], []
    for nsr in levels:
        batch = mf.Batch(y=y + nsr * np.sqrt(np.mean(y**2)) * normals, u=u, dt=dt)
        fits = mf.fit_many(batch, DUFFING, harmonics=13, correct=False, progress=False, threads=2)
        true = np.array([{"d": 0.3, "a": 1.0, "b": 0.5}[name] for name in fits.param_names])
        off = fits.params[fits.success] / true - 1
        size.append(np.sqrt(np.mean(off.mean(axis=0) ** 2)))
        error.append(np.sqrt(np.mean(off.var(axis=0)) / len(off)) / size[-1])
    return [Curve("bias", "bias by y³, uncorrected", levels, np.array(size), 2, np.array(error))]


def length(replicates: int) -> list[Curve]:
    """Scatter over samples in 10 s, and over seconds at 20 samples a second; stationary input."""
    out = []
    counts = np.array([64, 128, 256, 512, 1024])
    spread = [_scatter(INPUT, 10.0, int(n), replicates, 6, 23) for n in counts]
    out.append(Curve("length", "sd over N, 10 s", counts, np.array(spread), -0.5, _known(counts, replicates)))
    tones = "+".join(f"sin({0.9 * k + 0.31:.3f}*t + {k * k})" for k in range(6))
    seconds = np.array([40.0, 80.0, 160.0, 320.0])
    spread = [_scatter(tones, t, round(20 * t), replicates, round(1.2 * t), 24) for t in seconds]
    known = _known(seconds, replicates)
    out.append(Curve("length", "sd over T, 20 samples/s", seconds, np.array(spread), -0.5, known))
    return out


def _known(x: np.ndarray, replicates: int) -> np.ndarray:
    return np.full(x.size, 1 / np.sqrt(2 * replicates * 3))


def _scatter(u: str, duration: float, intervals: int, replicates: int, harmonics: int, seed: int) -> float:
    """Standard deviation of `ml`, rms over the parameters, noise of the same size everywhere."""
    clean = mf.simulate(SYSTEM, input=u, duration=duration, intervals=intervals)
    found = mf.MonteCarlo(
        system=SYSTEM, input=u, duration=duration, intervals=intervals, harmonics=harmonics, trend=None,
        nsr=float(0.02 / np.sqrt(np.mean(clean.y**2))), estimators=["ml"], replicates=replicates, seed=seed,
    ).run(threads=2, progress=False, coverage=False)  # fmt: skip
    return float(np.sqrt(np.mean((found.sd[0] / TRUE) ** 2)))


# Frequency responses -----------------------------------------------------------------------------


def responses() -> list[Curve]:
    """Error of local models without noise, over the length of the record: lines 1/T apart.

    The input is held for 0.1 s and sampled eight times as often, so that quadrature does not show. Medians
    over frequencies and inputs: at a line that a random input leaves empty the error is what it likes.
    """
    system = mf.tf([4], [1, 0.8, 4])
    omega = np.linspace(1.0, 3.5, 26)
    exact = system.frequency_response(omega).response[0, 0]
    seconds = np.array([50.0, 100.0, 200.0, 400.0])
    out = []
    for method, degree, theory in (("lpm", 1, 2), ("lpm", 2, 3), ("lpm", 3, 4), ("lrm", 1, 3)):
        errors = []
        for t in seconds:
            off = []
            for seed in range(12):
                n = round(80 * t)
                u = (
                    np.random.default_rng([int(t), seed])
                    .standard_normal(round(10 * t) + 1)
                    .repeat(8)[: n + 1]
                )
                y = system.simulate(u=u, dt=t / n, intersample="zoh", initial_state=[1.0, -1.0])
                rec = mf.Record(y=y, u=u, dt=t / n, intersample="zoh")
                found = mf.frf(
                    rec, omega, method=method, degree=degree, halfwidth=6, trend=None, progress=False
                )
                off.append(np.abs(found.response[0, 0] / exact - 1))
            errors.append(np.median(off))
        name, most = f"{method}, degree {degree}", 4 if (method, degree) == ("lpm", 2) else None
        out.append(Curve("response", name, 1 / seconds, np.array(errors), theory, most=most))
    return out


PANELS = {
    "coefficient": ("Fourier coefficient", "sampling interval (s)", "error of V(3)"),
    "estimate": ("Estimate without noise", "sampling interval (s)", "relative error of θ"),
    "hold": ("Form of the input", "sampling interval (s)", "relative error"),
    "integration": ("Integration", "tolerance, or length of a piece (s)", "relative error"),
    "bias": ("Noise", "noise over rms of y", "over the true values"),
    "length": ("Length", "samples N, or seconds T", "relative sd"),
    "response": ("Frequency response without noise", "line spacing 1/T (Hz)", "relative error"),
}
WHY = {
    "coefficient": "report, (21a)–(21c): 1/N, 1/N², 1/N⁴; Gregory with four end weights 1/N⁵",
    "estimate": "as the coefficients",
    "hold": "steps are first order; lines second; splines fourth; half a step out of time is first",
    "integration": "tolerance; Radau collocation with s points 2s − 1",
    "bias": "the regressors' errors enter squared; the estimate's scatter is linear in the noise",
    "length": "independent samples",
    "response": "a polynomial (degree R) leaves the (R+1)-th power of the spacing, "
    "of even R the (R+2)-th where the input's lines are alike; a fraction of degree R the (2R+1)-th",
}


def section(scale: float = 1.0, figure: Path | None = FIGURE) -> Section:
    """The section."""
    out = Section("Orders of convergence", reasons=REASONS)
    curves = [
        *quadrature(), *holds(), *integration(), *noise(max(int(400_000 * scale), 4000)),
        *duffing(max(int(2000 * scale), 200)), *length(max(int(20_000 * scale), 1000)), *responses(),
    ]  # fmt: skip
    out.say(
        "Slopes by least squares through the points in log-log, beside those of theory. A slope may differ "
        f"from theory by {NEAR} of an order, which is what errors of higher order add over steps that "
        "are not infinitely fine, and by three Monte Carlo standard errors besides, where there are any.",
        "![Errors and their slopes](figures/validation_orders.png)",
    )
    rows = []
    for c in curves:
        slope, error = c.fitted()
        top = c.theory if c.most is None else c.most
        good = c.theory - NEAR - 3 * error <= slope <= top + NEAR + 3 * error
        shown = f"{slope:.2f}" + (f" ± {error:.2f}" if error else "")
        span = f"{c.y[0]:.1e} … {c.y[-1]:.1e}"
        rows.append((PANELS[c.panel][0], c.name, c.said, shown, span, out.judge(c.name, good)))
    out.table(["", "what", "theory", "measured", "errors, first to last", ""], rows, left=2)
    out.say(
        "Where theory comes from: " + "; ".join(f"{PANELS[k][0].lower()}: {v}" for k, v in WHY.items()) + "."
    )
    if figure is not None:
        draw(curves, figure)
    return out


def draw(curves: list[Curve], figure: Path) -> None:
    """A panel a kind, slopes beside the names."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    fig, axes = plt.subplots(2, 4, figsize=(15, 9.6), layout="constrained")
    for (panel, (title, xlabel, ylabel)), ax in zip(PANELS.items(), axes.flat, strict=False):
        for k, c in enumerate(c for c in curves if c.panel == panel):
            slope, _ = c.fitted()
            ax.loglog(c.x, c.y, f"C{k}o", markersize=4, label=f"{c.name}: {slope:.2f} ({c.said})")
            last = c.y[-1] * (c.x / c.x[-1]) ** c.theory
            ax.loglog(c.x, last, f"C{k}-", linewidth=0.9)
        ax.set(title=title, xlabel=xlabel, ylabel=ylabel)
        points = sorted({float(x) for c in curves if c.panel == panel for x in c.x})
        if points[-1] < 20 * points[0]:  # little more than a decade: the points themselves
            ax.set_xticks(points, [f"{x:.2g}" for x in points], fontsize=8)
            ax.minorticks_off()
        ax.grid(True, which="major", alpha=0.3)
        ax.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(0.0, -0.17))
    axes.flat[-1].axis("off")
    axes.flat[-1].text(
        0.0, 0.9,
        "Points: measured.\nLines: slope of theory\nthrough the last point.\n"
        "Numbers: slope measured\n(of theory).",
        va="top", fontsize=11,
    )  # fmt: skip
    fig.savefig(figure, dpi=110)
    plt.close(fig)
