"""Samples, lines and estimates beside their slow twins."""

from __future__ import annotations

import modfun as mf
import numpy as np
from core_fit import fit
from gaps import Gaps
from modfun import _core
from oracle import banded, coefficients, default_band, joint, lines, systems, terms
from oracle import nonlinear as examples
from sample_records import random_record

EXACT = {"tol": 1e-13, "maxiter": 500}

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
        got = system.simulate(u=sampled, dt=0.08, initial_state=x0, intersample="zoh")
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
        # After a single step `ml` of the core may be 1e-6 away from its twin; from the second on they agree.
        for method, first in (("awls", 1), ("ml", 2)):
            x = lines.wls(problem)
            for step in range(1, 7):
                gamma, target = problem.system(x)
                j = problem.system(x, x)[0] if method == "ml" else gamma
                q = np.linalg.qr(j / np.linalg.norm(j, axis=0))[0]  # (JᵀΓ)⁻¹Jᵀγ₀
                x = np.linalg.solve(q.T @ gamma, q.T @ target)
                if step < first:
                    continue
                got = fit(record, order, [order - 1], method=method, harmonics=12, tol=1e-300, maxiter=step)
                want = x[: problem.p] * problem.unit
                gaps.add(f"`{method}`: iterates {first} to 6", 1e-6, got["theta"], want)


def bands(gaps: Gaps, count: int) -> None:
    for k in range(count // 3):
        order = 1 + k % 3
        record, _ = random_record(500 + k, order, order - 1, intervals=128 * order, nsr=0.02, duration=51.2)
        want = default_band.choose(record, order, [order - 1], None)
        rule = fit(record, order, [order - 1], trend=None)["band_rule"]
        if rule["k_max"] > want[0]:  # the choice met the end of eight samples per period, and went on
            continue
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
