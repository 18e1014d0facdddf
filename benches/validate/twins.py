"""The core beside the slow twins of tests/python/oracle: the greatest difference of each quantity."""

from __future__ import annotations

import modfun as mf
import numpy as np
from core_fit import fit
from modfun import _core
from oracle import (
    banded,
    bound,
    coefficients,
    default_band,
    joint,
    lines,
    observer,
    output_error,
    rank,
    response,
    systems,
    terms,
    timelag,
    tones,
)
from oracle import nonlinear as examples
from page import Section
from sample_records import random_record

CASES = 24  # random ones of each kind
EXACT = {"tol": 1e-13, "maxiter": 500}


class Gaps:
    """Greatest difference and number of comparisons, a quantity each."""

    def __init__(self) -> None:
        self.rows: dict[str, list[float]] = {}

    def add(self, name: str, limit: float, got: object, want: object, size: float | None = None) -> None:
        """|got − want| over the largest |want|, or over `size`."""
        got, want = np.asarray(got), np.asarray(want)
        gap = float(np.max(np.abs(got - want)) / (np.max(np.abs(want)) if size is None else size))
        row = self.rows.setdefault(name, [0, 0.0, limit])
        row[0] += 1
        row[1] = float(np.maximum(row[1], gap))  # nan stays


# Samples and lines -------------------------------------------------------------------------------


def spectra(gaps: Gaps, count: int) -> None:
    rng = np.random.default_rng(1)
    for _ in range(count):
        n = 2 * int(rng.integers(20, 400))
        v, top = rng.standard_normal(n + 1), int(rng.integers(1, n // 2))
        for kind in (*coefficients.RULES, *coefficients.HOLDS):
            late = float(rng.uniform(0, 3)) if kind in coefficients.HOLDS else 0.0
            lead = int(np.ceil(late))
            top = min(top, (n - lead) // 2)
            got = _core.coefficients(v[None], top, [kind], [late], lead, None)[0]
            want = coefficients.coefficients(v, top, kind, late, lead)
            word = "with a fractional delay" if kind in coefficients.HOLDS else "by the four rules"
            gaps.add(
                f"Fourier coefficients, {word}" if "four" in word else f"held inputs, {word}",
                1e-12,
                got,
                want,
            )


def simulated(gaps: Gaps, count: int) -> None:
    rng = np.random.default_rng(2)
    for k in range(count):
        order = 1 + k % 4
        den, nums = systems.random_system(rng, order, min(k % 3, order - 1), 2)
        drives, x0 = systems.random_inputs(rng, 2), rng.normal(size=order)
        sampled = rng.standard_normal((2, 161))
        want, _ = systems.simulate(den, nums, drives, 0.08, 160, x0, sampled)
        system = mf.tf([nums], den)
        got = system.simulate(u=sampled, dt=0.08, x0=x0, intersample="zoh")
        gaps.add("responses to held inputs", 1e-11, np.ravel(got), want)
        want, _ = systems.simulate(den, nums, drives, 0.08, 160, x0)
        got = mf.simulate(system, input=drives, duration=12.8, intervals=160, initial_state=x0).y[0]
        gaps.add("responses to smooth inputs", 1e-9, got, want)


def regressors(gaps: Gaps, count: int) -> None:
    for k in range(count):
        order, inputs = 1 + k % 3, 1 + k % 2
        record, _ = random_record(100 + k, order, order - 1, inputs=inputs)
        top, extended = 6 + k % 7, k % 2 == 0
        model = mf.TransferFunction(poles=order, zeros=[order - 1] * inputs)
        rec = mf.Record(y=record.y, u=record.u, dt=record.dt)
        got = mf.regressors(rec, model, harmonics=top, extended=extended)
        twin = banded.Differenced(record, order, [order - 1] * inputs, top, extended)
        gamma, target = twin.regressors()
        size = np.max(np.abs(gamma), axis=0)
        # The twin counts s in the highest line's frequency, and has everything on the other side.
        scaled = got.gamma * twin.unit / twin.scale**order
        gaps.add("regressors [15, 16]", 1e-11, -scaled / size, gamma / size, 1.0)
        gaps.add("target [16]", 1e-11, -got.target / twin.scale**order, target)


# Estimates ---------------------------------------------------------------------------------------


def estimates(gaps: Gaps, count: int) -> None:
    for k in range(count):
        order, inputs = 1 + k % 3, 1 + k % 2
        zeros = [order - 1] * inputs
        record, _ = random_record(200 + k, order, order - 1, inputs=inputs, nsr=0.02)
        options = {"harmonics": 7 + k % 6, "extended": k % 2 == 0, **EXACT}
        twin = banded.Differenced(record, order, zeros, options["harmonics"], options["extended"])
        for method in ("ls", "wls", "awls", "ml"):
            found = fit(record, order, zeros, method=method, **options)
            cost, _, cov = banded.covariance(twin, found["theta"], method)
            gaps.add(f"`{method}`: θ, differenced rows", 1e-8, found["theta"], getattr(banded, method)(twin))
            gaps.add("cost, differenced rows", 1e-8, found["cost"], cost)
            gaps.add("classical covariance, differenced rows", 1e-6, found["cov_nonrobust"], cov)


def scipy_fits(gaps: Gaps, count: int) -> None:
    for k in range(count):
        order = 1 + k % 5
        zeros = k % order
        record, _ = random_record(300 + k, order, zeros, intervals=640, nsr=0.003, duration=51.2)
        trend = (None, "constant", "linear")[k % 3]
        problem = lines.Problem([record], order, [zeros], 40, trend=trend)
        found = fit(record, order, [zeros], harmonics=40 - order, trend=trend, **EXACT)
        want = lines.result(problem, lines.ml(problem, found["theta"]))
        gaps.add("`ml`: θ, SciPy on the lines, orders 1 to 5", 1e-5, found["theta"], want.theta)
        gaps.add("`ml`: cost, SciPy on the lines", 1e-8, found["cost"], want.cost)
        gaps.add("classical covariance, dense", 1e-4, found["cov_nonrobust"], want.cov)
        gaps.add("HC3 covariance, dense", 1e-4, found["cov_hc3"], want.cov_hc3)


def iterates(gaps: Gaps, count: int) -> None:
    for k in range(count):
        order = 1 + k % 3
        record, _ = random_record(400 + k, order, order - 1, nsr=0.03)
        problem = lines.Problem([record], order, [order - 1], 12 + order)
        for method in ("awls", "ml"):
            x = lines.wls(problem)
            for step in range(1, 7):
                gamma, target = problem.system(x)
                j = problem.system(x, x)[0] if method == "ml" else gamma
                q = np.linalg.qr(j / np.linalg.norm(j, axis=0))[0]  # (JᵀΓ)⁻¹Jᵀγ₀
                x = np.linalg.solve(q.T @ gamma, q.T @ target)
                got = fit(record, order, [order - 1], method=method, harmonics=12, tol=1e-300, maxiter=step)
                want = x[: problem.p] * problem.unit
                gaps.add(f"`{method}`: iterates 1 to 6", 1e-6, got["theta"], want)


def bands(gaps: Gaps, count: int) -> None:
    for k in range(count // 3):
        order = 1 + k % 3
        record, _ = random_record(500 + k, order, order - 1, intervals=128 * order, nsr=0.02, duration=51.2)
        want = default_band.choose(record, order, [order - 1], None)
        rule = fit(record, order, [order - 1], trend=None)["band_rule"]
        gaps.add(
            "the default band, lines", 0.0, [rule["k_max"], rule["k_0"], rule["k"]], [*want[:2], want[4]]
        )
        gaps.add("costs on the way to it", 1e-8, [rule["cost_wide"], rule["cost_narrow"]], want[2:4])


def several(gaps: Gaps, count: int) -> None:
    t = 0.05 * np.arange(401)
    u = np.array([np.sin(t**2 / 6), np.cos((20 - t) ** 2 / 5)])
    root = np.array([[0.1, 0.0], [0.05, 0.02]])
    zeros = [[1, 0], [0, 1]]
    clean = mf.tf([[[1.0, 2.0], [3.0]], [[0.5], [-1.0, 0.7]]], [1.0, 1.2, 4.0]).simulate(u=u, dt=0.05)
    for k in range(count // 4):
        rng = np.random.default_rng(600 + k)
        rec = mf.Record(y=clean + root @ rng.standard_normal(clean.shape), u=u, dt=0.05)
        denominator = ("common", "separate")[k % 2]
        structure = mf.TransferFunction(poles=2, zeros=zeros, denominator=denominator)
        noise = mf.Noise(y=root @ root.T)
        known = mf.fit(rec, structure, noise=noise, band=6.0)
        twin = joint.Joint(rec.y, rec.u, 0.05, *known.lines[0], 2, zeros, denominator == "common")
        gaps.add("several outputs, Σ known: θ", 1e-6, known.params, twin.solve(known.params, root @ root.T))
        free = mf.fit(rec, structure, band=6.0)
        theta, sigma = twin.alternate(free.params)
        gaps.add("several outputs, Σ estimated: θ", 1e-5, free.params, theta)
        gaps.add("several outputs: Σ", 1e-4, free.noise_cov, sigma)


def general(gaps: Gaps, count: int) -> None:
    model = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
    case = examples.duffing(512)
    sigma = 0.1 * np.sqrt(np.mean(case.v[0] ** 2))
    for k in range(count // 6):
        y = case.v[0] + sigma * np.random.default_rng(700 + k).standard_normal(case.t.size)
        rec = mf.Record(y=y, u=case.u(case.t), dt=case.t[1])
        problem = terms.Problem(case.terms, y, rec.dt, sigma, 13)
        start = terms.wls(problem, [0.0, 1.0, 0.0])
        for method in ("ls", "wls", "awls", "ml"):
            found = mf.fit(rec, model, method=method, harmonics=11, noise=mf.Noise(y=sigma), tol=1e-12)
            want = getattr(terms, method)(problem, start)
            if method == "ml":  # once more, with slopes where the noise is taken away
                whiten, _, residual = problem.at_theta(want, want)
                at = problem.v - problem.noise(want, whiten, residual)
                again = terms.Problem(case.terms, y, rec.dt, sigma, 13, at=at)
                dense = terms.fit(again, "ml", terms.ml(again, want))
                gaps.add(
                    "equation: HC3 errors", 0.02, np.diag(found.cov_hc3) ** 0.5, np.diag(dense.cov_hc3) ** 0.5
                )
                want = dense.theta
            if method in ("ls", "wls"):
                gaps.add("equation, `ls` and `wls`: θ", 1e-8, found.params, want)
            else:
                gap = np.abs(found.params - want) / found.bse
                gaps.add("equation, `awls` and `ml`: θ, in standard errors", 0.02, gap, 0 * gap, 1.0)
    case = examples.short_period(600)
    sigma = 0.1 * np.sqrt(np.mean(case.v**2, axis=1))
    names = ("Za", "Zd", "Ma", "Mq", "Md")
    state = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
    for k in range(max(count // 12, 1)):
        v = case.v + sigma[:, None] * np.random.default_rng(800 + k).standard_normal(case.v.shape)
        rec = mf.Record(y=v, u=case.u(case.t), dt=case.t[1], outputs=["alpha", "q"], inputs=["de"])
        found = mf.fit(rec, state, trend=None, harmonics=13, noise=mf.Noise(y=sigma), tol=1e-12)
        problem = terms.Problem(case.terms, v, rec.dt, sigma, 14)
        dense = terms.fit(problem, "ml", terms.wls(problem, [-1.0] * 5))
        gap = np.array([found[name] for name in names]) - dense.theta
        gap = gap / np.sqrt(np.diag(dense.cov))
        gaps.add("state equations, `ml`: θ, in standard errors", 0.02, gap, 0 * gap, 1.0)


# Around the estimate -----------------------------------------------------------------------------


def local_models(gaps: Gaps, count: int) -> None:
    from test_frf import coefficients as held
    from test_frf import two_by_two

    at = [1, 3, 12, 100, 250]
    for k in range(count // 4):
        rec, _ = two_by_two(k)
        y, u, spacing = held(rec)
        for degree in (1, 2, 3):
            words = {"halfwidth": 12, "degree": degree, "trend": None, "progress": False}
            poly = mf.frf(rec, np.array(at) * spacing, method="lpm", **words)
            frac = mf.frf(rec, np.array(at) * spacing, method="lrm", weighting="awls", **words)
            for i, line in enumerate(at):
                gains, cov, _ = response.transient(y, u, line, 12, degree)
                gaps.add("frequency response, polynomials", 1e-9, poly.response[:, :, i], gains)
                gaps.add("its covariance", 1e-9, poly.cov[i], cov)
                want = response.rational(y, u, line, 12, degree, 3)
                gaps.add("frequency response, fractions reweighted", 1e-6, frac.response[:, :, i], want)


def sinusoids(gaps: Gaps, count: int) -> None:
    for k in range(count):
        rng = np.random.default_rng(900 + k)
        omega = np.sort(rng.uniform(0.3, 2.8, 2))
        if omega[1] - omega[0] < 0.2:
            continue
        truth = np.concatenate([omega, rng.uniform(0.5, 2, 2), rng.uniform(-2, 2, 2)])
        y = tones.waves(*truth.reshape(3, 2), 128) + 1.0 + 0.2 * rng.standard_normal(128)
        rec = mf.Record(y=y, dt=1.0)
        found = mf.sinusoids(rec, 2)
        want, cost = tones.refined(y, truth)
        gaps.add("sinusoids: ω, amplitude, phase", 2e-6, found.params, want)
        gaps.add("sinusoids: cost", 1e-9, found.cost, cost)
        cov = tones.bound(*found.params.reshape(3, 2), found.sigma**2, 128, offset=True)
        gaps.add("sinusoids: standard errors", 1e-6, found.bse, np.sqrt(np.diag(cov)))
        own = mf.sinusoids(rec, 2, method="awls", lines=5, trend=None)
        start = mf.sinusoids(rec, 2, trend=None).omega
        gaps.add("sinusoids, `awls`: ω", 1e-6, own.omega, tones.awls(y, start, tones.around(start, 5, 128)))


def lags(gaps: Gaps, count: int) -> None:
    for k in range(count):
        rng = np.random.default_rng(1000 + k)
        a0, a1, h = (
            float(rng.normal()),
            float(rng.choice([-1, 1]) * rng.uniform(0.5, 3)),
            float(rng.uniform(0.3, 2)),
        )
        found = mf.timelag.DelaySystem(A={0: a0, h: a1}).poles(20)
        want = timelag.scalar_roots(a0, a1, h)[: len(found)]
        gap = np.abs(found.values[:, None] - want).min(axis=0) / np.abs(want)
        gaps.add("roots with a time lag, Lambert's W", 1e-11, gap, 0 * gap, 1.0)
    plant = mf.timelag.DelaySystem(
        A={0: [[0.3, 1], [-1, 0.2]], 1: [[0.5, -0.2], [0.1, 0.4]], 0.375: [[0, 0.3], [0.2, 0]]},
        B={0: [0.2, 0.3], 0.4: [1, 0], 0.9: [0, -1]},
    )

    def past(t: float) -> np.ndarray:
        return np.array([np.cos(t), 0.3 * t])

    def u(t: float) -> np.ndarray:
        return np.array([np.sin(2 * t) if t >= 0 else 0.5])

    run = plant.simulate(duration=3, dt=0.1, history=past, u="sin(2*t)", input_history=0.5)
    _, coarse = timelag.steps(plant.A, plant.B, past, u, 3.0, 1200)
    _, fine = timelag.steps(plant.A, plant.B, past, u, 3.0, 2400)
    want = fine[:, ::80] + (fine[:, ::80] - coarse[:, ::40]) / 15
    gaps.add("responses with time lags, fixed steps", 1e-7, run.x, want)


def bounds(gaps: Gaps, count: int) -> None:
    model = output_error.OutputError(systems.chirp, 10 / 256, 256)
    for k in range(count):
        rng = np.random.default_rng(1100 + k)
        theta = np.array([3.0, 8.0, 5.0]) * rng.uniform(0.6, 1.5, 3)
        system = mf.tf([theta[2]], [1, theta[0], theta[1]])
        rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256)
        want = np.sqrt(np.diag(model.bound([*theta, 0, 0], 0.1)))
        gaps.add("Cramér–Rao bound, transfer function", 1e-6, mf.crlb(system, rec, sigma=0.1).sd / want, 1.0)
    values = {"Za": -0.8, "Ma": -4.5, "Mq": -1.2, "Zd": -0.1, "Md": -5.0}
    state = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
    de = mf.signals.multistep("de", unit=0.4, dt=0.05, amplitude=0.03, before=0.5, duration=8.0)
    cov = np.array([[4e-6, 3e-6], [3e-6, 1.6e-5]])

    def short_period(z: np.ndarray) -> np.ndarray:
        a, b = np.array([[z[0], 1], [z[1], z[2]]]), np.array([[z[3]], [z[4]]])
        return bound.held(a, b, np.eye(2), np.zeros((2, 1)), de.u, 0.05, z[5:7])

    for k in range(count // 6):
        moved = {n: v * float(np.random.default_rng(1200 + k).uniform(0.7, 1.4)) for n, v in values.items()}
        want = np.sqrt(np.diag(bound.bound(short_period, [*moved.values(), 0, 0], 5, cov)))
        got = mf.crlb(state, de, params=moved, sigma=cov).sd
        gaps.add("Cramér–Rao bound, state equations", 1e-6, got / want, 1.0)


def others(gaps: Gaps, count: int) -> None:
    from golden.test_normals import PURPOSES, expected
    from modfun.observer import observe
    from test_observer import responses

    rng = np.random.default_rng(1300)
    for k in range(count):
        address = (int(rng.integers(2**63)), PURPOSES[k % 5], k, int(rng.integers(2**40)), k % 3)
        gaps.add(
            "normals, independent derivation", 1e-12, _core.normals(*address, 257), expected(*address, 257)
        )
        record, _ = random_record(1400 + k, 3, 1, inputs=2)
        shown = mf.rank_test(mf.Record(y=record.y, u=record.u, dt=record.dt), poles=4)["singular_value"]
        level = _core.noise_level(np.ascontiguousarray(record.y[None]), 4)[0]
        gaps.add("rank test", 1e-7, shown, rank.singular_values(record, 4, len(record.y) // 8, level))
        poles = np.array([-rng.uniform(0.3, 2), -1 + 1j * rng.uniform(1, 3)])
        den = np.poly([poles[0], poles[1], poles[1].conj()]).real
        a, c = np.vstack([np.eye(3, k=1)[:-1], -den[:0:-1]]), np.eye(3)[:1]
        x0 = rng.normal(size=3)
        y = np.tensordot(x0, responses(a, c, 501, 0.02), 1)
        gaps.add("initial state, observer, no noise", 1e-6, observe(a, c, y, 0.02).state, x0)
        if k < 3:  # another gain, started at zero, in continuous time: near, as the step allows
            wanted = np.array([-4.0, -3.0 + 2j, -3.0 - 2j])
            own = observe(a, c, y, 0.02, eigenvalues=wanted).state
            twin = observer.initial_state(a, c, y, 0.02, wanted)
            gaps.add("initial state, observer in continuous time", 1e-2, own, twin)


def reductions(gaps: Gaps, count: int) -> None:
    from oracle import norms
    from test_reduction import difference, random_system

    for seed in range(count // 4):
        system = random_system(seed=seed)
        red = mf.reduce(system, 3)
        a, b, c, d = difference(system, red.model)
        gaps.add("H2 norm of a difference", 1e-7, red.h2_error, norms.h2(a, b, c))
        gaps.add("H-infinity norm of a difference", 1e-6, red.hinf_error, norms.hinf(a, b, c, d))
        whole = norms.hankel(system.A, system.B, system.C)
        gaps.add("Hankel singular values", 1e-8, red.hankel, whole[: red.hankel.size])


KINDS = (
    spectra, simulated, regressors, estimates, scipy_fits, iterates, bands, several, general, local_models,
    sinusoids, lags, bounds, others, reductions,
)  # fmt: skip


def section(scale: float = 1.0) -> Section:
    """The section."""
    out = Section("Agreement with slow twins")
    gaps = Gaps()
    for kind in KINDS:
        kind(gaps, max(int(CASES * scale), 12))
    out.say(
        "`tests/python/oracle` holds twins of the core in plain NumPy and SciPy, written from the formulas: naive "
        "sums, dense covariances, Levenberg–Marquardt, adaptive integrators. They share no code with modfun. "
        "Below the greatest difference over random systems, records and options; relative to the largest number "
        "of the vector or matrix unless the row says otherwise. What a twin gives by an iteration or by "
        "differences has the digits of these, and the limit says so."
    )
    rows = [
        (name, count, f"{gap:.1e}", f"{limit:.0e}" if limit else "equal", out.judge(name, gap <= limit))
        for name, (count, gap, limit) in gaps.rows.items()
    ]
    out.table(["quantity", "comparisons", "greatest difference", "limit", ""], rows)
    total = int(sum(row[0] for row in gaps.rows.values()))
    out.say(f"{total:,} comparisons in all.")
    out.say(
        "Where the twin differs on purpose: those of equations weigh end samples as the rule does, the core "
        "evenly, so that `awls` and `ml` agree to a part of a standard error and not to digits."
    )
    return out
