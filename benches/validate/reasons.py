"""Why some intervals do not cover: each reason of `covering` tried, by taking the cause away."""

from __future__ import annotations

from collections.abc import Iterator

import modfun as mf
import numpy as np
from intervals import CLEAN, EQ24, RMS, TF2, autoregressive
from scipy.linalg import expm
from scipy.stats import t as student

TRUE = np.array([3.0, 8.0, 5.0])
FEW = {"harmonics": 11, "trend": None, "cov_type": "nonrobust"}
HEAD = ("intervals, records", "taken away", "covered, %", "without it, %")


def rows(scale: float) -> Iterator[tuple[str, ...]]:
    """A row a reason: coverage, mean over the parameters, with and without its cause."""
    for method, nsr in (("ls", 0.05), ("ls", 0.2), ("wls", 0.05), ("wls", 0.2)):
        yield from wide(method, nsr, max(int(4000 * scale), 100))
    yield biased(max(int(20_000 * scale), 500))
    yield coloured(max(int(1200 * scale), 20))
    yield uneven(max(int(1200 * scale), 50))
    yield started(max(int(8000 * scale), 50))


def share(inside: object) -> str:
    """Mean of what lies inside, in %."""
    return f"{100 * float(np.mean(inside)):.1f}"


def noisy(nsr: float, count: int, seed: int) -> Iterator[mf.Record]:
    """The report's example in white noise."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield mf.Record(y=CLEAN.y + nsr * RMS * rng.standard_normal(CLEAN.y.shape), u=CLEAN.u, dt=CLEAN.dt)


def wide(method: str, nsr: float, count: int) -> Iterator[tuple[str, ...]]:
    """Classical intervals of `ls` and `wls`, about the mean of the estimates, by part of the standard error."""
    options = FEW | {"method": method}
    fits = [mf.fit(rec, TF2, **options) for rec in noisy(nsr, count, 52)]
    theta, sigma = np.array([f.params for f in fits]), np.array([f.sigma for f in fits])[:, None]
    shape = np.array([f.bse for f in fits]) / sigma
    quiet = mf.fit(CLEAN, TF2, **options)
    off = np.abs(theta - theta.mean(axis=0))
    few = student.ppf(0.975, quiet.df_resid)
    plain, true = quiet.bse / quiet.sigma, nsr * RMS
    name = f"`{method}`, NSR {nsr:g}, classical, about their own mean, {count:,}"
    given = share(off <= few * sigma * shape)
    for half, word in (
        (
            1.96 * true * shape,
            f"the error of σ, which is {np.mean(sigma) / true:.2f} times the true one in the mean",
        ),
        (few * sigma * plain, "the noise in the columns"),
        (1.96 * true * plain, "both"),
    ):
        yield name, word, given, share(off <= half)


def biased(count: int) -> tuple[str, ...]:
    """Intervals of `awls` about the truth and about the mean of the estimates."""
    e = 0.2 * RMS * np.random.default_rng(53).standard_normal((count, *CLEAN.y.shape))
    found = mf.fit_many(
        mf.Batch(y=CLEAN.y + e, u=CLEAN.u, dt=CLEAN.dt), TF2, method="awls", progress=False, **FEW
    )
    half = student.ppf(0.975, found.df_resid) * found.bse
    inside = [share(np.abs(found.params - m) <= half) for m in (TRUE, found.params.mean(axis=0))]
    return f"`awls`, NSR 0.2, classical, {count:,}", "the bias: about the mean of the estimates", *inside


def coloured(count: int) -> tuple[str, ...]:
    """AR(0.95) noise: its spectrum fitted, and given."""

    def spectrum(omega: np.ndarray) -> np.ndarray:
        return (0.1 * RMS) ** 2 * (1 - 0.95**2) / np.abs(1 - 0.95 * np.exp(-1j * omega * CLEAN.dt)) ** 2

    inside: list[list[np.ndarray]] = [[], []]
    for k in range(count):
        e = autoregressive(np.random.default_rng([41, k]), CLEAN.y[0], CLEAN.dt)
        rec = mf.Record(y=CLEAN.y + 0.1 * RMS * e, u=CLEAN.u, dt=CLEAN.dt)
        for one, noise in zip(inside, ("coloured", mf.Noise(y=spectrum)), strict=True):
            fit = mf.fit(rec, TF2, noise=noise, band=20.0, trend=None)
            half = student.ppf(0.975, fit.df_resid) * np.sqrt(np.diag(fit.cov_nonrobust))
            one.append(np.abs(fit.params - TRUE) <= half)
    name = f'AR(0.95) noise, noise="coloured", classical, {count:,}'
    return name, "the fit of the spectrum: the true one is given", *map(share, inside)


def uneven(count: int) -> tuple[str, ...]:
    """Four times the noise on 40 %: the errors that the true covariance of the lines gives."""
    level = 0.05 * RMS * np.where(np.arange(257) < 154, 1.0, 4.0)
    theta, half = [], []
    for k in range(count):
        e = level * np.random.default_rng([42, k]).standard_normal(257)
        fit = mf.fit(mf.Record(y=CLEAN.y + e, u=CLEAN.u, dt=CLEAN.dt), TF2, **FEW)
        theta.append(fit.params)
        half.append(student.ppf(0.975, fit.df_resid) * fit.bse)
    jacobian, noise = lines(fit.lines[0][1])
    h = np.linalg.inv(jacobian.T @ jacobian)
    rows_of = noise * level  # of whitened rows, by sample
    cov = h @ jacobian.T @ rows_of @ rows_of.T @ jacobian @ h
    off = np.abs(np.array(theta) - TRUE)
    known = 1.96 * np.sqrt(np.diag(cov))[:3]
    name = f"noise 4 times as strong on 40 % of the record, classical, {count:,}"
    return name, "independence: the true covariance of the lines", share(off <= half), share(off <= known)


def lines(top: int) -> tuple[np.ndarray, np.ndarray]:
    """At the truth: the Jacobian of the whitened rows, transient last, and these rows of unit samples."""
    c = mf.coefficients(CLEAN, top)
    y, u, s = c.y[0], c.u[0], 1j * c.omega
    a = s**2 + 3 * s + 8
    half = np.r_[1.0, np.full(2 * top, 0.5)]

    def rows_of(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values.real, values.imag[1:]]) / np.sqrt(
            half * np.r_[np.abs(a), np.abs(a[1:])] ** 2
        )

    ends = np.stack([rows_of(np.ones_like(s)), rows_of(s)], axis=1)
    tau = np.linalg.lstsq(ends, rows_of(a * y - 5 * u), rcond=None)[0]
    clean = (5 * u + tau[0] + tau[1] * s) / a
    columns = [rows_of(-s * clean), rows_of(-clean), rows_of(u)]
    units = [mf.coefficients(mf.Record(y=one, u=CLEAN.u, dt=CLEAN.dt), top).y[0] for one in np.eye(257)]
    return np.column_stack([*columns, ends]), np.column_stack([rows_of(a * e) for e in units])


def started(count: int) -> tuple[str, ...]:
    """The initial state by least squares: after a fit, and with the true model."""
    system, start, t = EQ24["system"], np.array([0.3, -0.5]), CLEAN.t
    free = np.array([expm(np.array([[0.0, 1.0], [-8.0, -3.0]]) * one)[0] for one in t])
    forced = system.simulate(u=CLEAN.u[0], dt=CLEAN.dt)
    information = np.linalg.inv(free.T @ free)
    inside: list[list[np.ndarray]] = [[], []]
    for k in range(count):
        rec = mf.simulate(
            system, input=EQ24["input"], duration=10.0, intervals=256, nsr=0.1, seed=47, replicate=k,
            initial_state=start,
        )  # fmt: skip
        found = mf.fit(rec, TF2, **FEW).initial_state(rec)
        inside[0].append(np.abs(found.state - start) <= 1.96 * found.bse)
        left = rec.y[0] - forced
        state = information @ free.T @ left
        sigma = np.sqrt(np.sum((left - free @ state) ** 2) / (t.size - 2))
        inside[1].append(np.abs(state - start) <= 1.96 * sigma * np.sqrt(np.diag(information)))
    return (
        f"initial state by least squares, {count:,}",
        "the error of the model: the true one",
        *map(share, inside),
    )
