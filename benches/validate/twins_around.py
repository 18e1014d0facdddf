"""What surrounds an estimate beside its slow twins: responses, tones, time lags, bounds, states, norms."""

from __future__ import annotations

import modfun as mf
import numpy as np
from gaps import Gaps
from modfun import _core
from oracle import bound, norms, observer, output_error, rank, response, systems, timelag, tones
from sample_records import random_record
from test_frf import coefficients as held
from test_frf import two_by_two
from test_observer import responses
from test_reduction import difference, random_system


def local_models(gaps: Gaps, count: int) -> None:
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
    from modfun.results.observer import observe

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
    for seed in range(count // 4):
        system = random_system(seed=seed)
        red = mf.reduce(system, 3)
        a, b, c, d = difference(system, red.model)
        gaps.add("H2 norm of a difference", 1e-7, red.h2_error, norms.h2(a, b, c))
        gaps.add("H-infinity norm of a difference", 1e-6, red.hinf_error, norms.hinf(a, b, c, d))
        whole = norms.hankel(system.A, system.B, system.C)
        gaps.add("Hankel singular values", 1e-8, red.hankel, whole[: red.hankel.size])
