"""Candidate terms of equations on the lines of records: covariance of the noise, maximum likelihood, moments.

The residual of equation e on line m is Σ_p s^p E_p − θ-weighted candidates, with E_p any signals. White noise
of the outputs enters it through the slopes of the signals, so that the covariance of all lines and equations
depends on θ. The gradient of the likelihood takes from each candidate what the smoothed noise puts into it
(`Moments.at`), which makes the candidates' Gram matrix that of the likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._core import coefficients as core_coefficients
from .._core import quadrature_weights
from ..base.arrays import C128, F64
from ..records.corners import driving
from ..records.record import Record

__all__ = ["Estimate", "Lines", "Quadratic", "cost_of", "estimate", "signal_edge"]

LOUD, SPREAD = 6.0, 4  # power over that of noise, and half the lines it is averaged over
ROUNDING = 1e-10  # of the covariance, for lines that noise does not reach
NEAR, PART = 8, 0.3  # lines on both sides that residuals are averaged over, and a part of the frequency more
RANK = 1e-10  # of columns of unit length
STEPS, SETTLED = 25, 1e-4  # of the likelihood; squared step in standard errors
FREE, HALVINGS = 2, 6  # first steps, which may raise the cost; halvings of a later one
UPHILL = 0.25  # of the rise of a step that half of it has, at least, where no part of it lowers a parabola


@dataclass(frozen=True)
class Quadratic:
    """Cost near an estimate, cost + (θ − θ₀)ᵀG(θ − θ₀) − 2 gᵀ(θ − θ₀), over all candidates.

    Attributes
    ----------
    cost : float
    gram : ndarray, shape (candidate, candidate)
    right : ndarray, shape (candidate,)
        G θ₀ + g: the estimate of a subset S solves G_SS θ = right_S.
    """

    cost: float
    gram: F64
    right: F64
    constant: float


@dataclass(frozen=True)
class Estimate:
    """Maximum-likelihood estimate of some candidates; the others are zero."""

    theta: F64
    quadratic: Quadratic
    settled: bool
    smooth: list[F64]

    @property
    def cost(self) -> float:
        """Weighted sum of squares."""
        return self.quadratic.cost


class Lines:
    """One record on its lines 0 … top.

    Parameters
    ----------
    k : int
        Which one of them the record is.
    record : Record
    y : ndarray, shape (output, time)
        Its outputs, masked samples interpolated.
    columns : Columns
        Of the targets, followed by the candidates.
    equation : ndarray of int, shape (candidate,)
        Which target each candidate belongs to.
    variances : ndarray, shape (output, time)
    top : int
    unit : float
        rad/s that frequencies are measured in.

    Attributes
    ----------
    implicit : ndarray of bool, shape (candidate,)
        Whether each one has a derivative as high as its target's, of what is measured with noise.
    """

    def __init__(
        self,
        k: int,
        record: Record,
        y: F64,
        columns: Any,
        equation: Any,
        variances: F64,
        top: int,
        unit: float,
    ) -> None:
        self.k, self.record, self.y, self.columns, self.equation = k, record, y, columns, np.asarray(equation)
        self.variances, self.top = variances, top
        n = record.intervals
        omega0 = 2 * np.pi / record.duration
        # Even samples by fast transforms; uneven ones by sums with e^(-iωt), (time, line 0 … 2 top).
        self.t = None if record.dt is not None else record.t - record.t[0]
        lines = np.arange(2 * top + 1) * omega0
        self.waves = None if self.t is None else np.exp(-1j * np.outer(self.t, lines))
        self.weights = quadrature_weights("gregory", n, self.t) / (n if self.t is None else record.duration)
        scale = unit ** np.arange(columns.parts.shape[1])
        parts = columns.parts * scale[None, :, None]
        count = len(columns.texts) - self.equation.size
        self.targets, self.candidates = parts[:count], parts[count:]
        self.orders = [_order(p) for p in self.targets]
        for e, p in zip(self.equation, self.candidates, strict=True):
            self.orders[e] = max(self.orders[e], _order(p))
        self.s = 1j * np.arange(top + 1) * omega0 / unit
        self.powers = np.asarray(self.s[None, :] ** np.arange(parts.shape[1])[:, None], dtype=np.complex128)
        good = variances if record.mask is None else np.where(record.mask, variances, 0.0)
        signals, slopes = columns.values(k, y, driving(record), record.t, good)
        self.signals = self._lines(signals, columns.kinds(k))
        self.slopes = slopes
        lowest = np.array([_order(p) for p in self.targets])[self.equation]
        noisy = self.candidates[:, :, np.any(slopes != 0, axis=(1, 2))]
        self.implicit = np.array([_order(p) >= max(least, 1) for p, least in zip(noisy, lowest, strict=True)])
        self.target_lines = self._columns(self.targets, self.signals)
        self.candidate_lines = self._columns(self.candidates, self.signals)
        self.transient = self._transient()
        self.spread = np.ones((2 * top + 1) * count)  # of whitened residuals, over that of white noise

    def bend(self, y: F64) -> None:
        """Take slopes at outputs without noise."""
        self.slopes = self.columns.values(self.k, y, driving(self.record), self.record.t, 0 * self.variances)[
            1
        ]

    def _lines(self, rows: F64, kinds: Sequence[str]) -> C128:
        if not len(rows):
            return np.zeros((0, self.top + 1), dtype=np.complex128)
        return core_coefficients(
            np.ascontiguousarray(rows), self.top, list(kinds), [0.0] * len(rows), 0, self.t
        )

    def _columns(self, parts: F64, lines: C128) -> C128:
        """Σ_p s^p Σ parts·lines: (part, line)."""
        return np.asarray(np.einsum("jps,pm,sm->jm", parts, self.powers, lines, optimize=True))

    def _rows(self, lines: C128, equation: Any) -> F64:
        """Lines (column, line) of equations as real rows (row, column)."""
        count, own = 2 * self.top + 1, len(self.orders)
        rows = np.zeros((own * count, len(lines)))
        for k, e in enumerate(equation):
            rows[e * count : e * count + self.top + 1, k] = lines[k].real
            rows[e * count + self.top + 1 : (e + 1) * count, k] = lines[k].imag[1:]
        return rows

    def _transient(self) -> F64:
        """What the ends of the record add: a real polynomial in s with as many terms as the order."""
        found = []
        for e, order in enumerate(self.orders):
            if order:
                found.append(self._rows(self.powers[:order], [e] * order))
        return np.hstack(found) if found else np.zeros(((2 * self.top + 1) * len(self.orders), 0))

    def rough(self) -> tuple[F64, F64]:
        """Gram matrix and right side with equal weights, each equation in units of its target."""
        targets = self._rows(self.target_lines, range(len(self.orders)))
        free = _without(self.transient, targets)
        power = np.maximum(np.sum(free**2, axis=0), 1e-300)
        columns = _without(self.transient, self._rows(self.candidate_lines, self.equation))
        columns /= np.sqrt(power[self.equation])
        total = np.sum(free / np.sqrt(power), axis=1)
        return columns.T @ columns, columns.T @ total

    def at(self, theta: F64, which: Any) -> tuple[Quadratic, F64]:
        """The cost at θ, its slope and curvature, and the outputs with the smoothed noise taken away.

        Slope and curvature are those of the candidates `which`, among them all that are not zero in θ.
        """
        from scipy.linalg import solve_triangular

        theta, equation, candidates = theta[which], self.equation[which], self.candidates[which]
        found = self._whitened(theta, which)
        if found is None:
            return self._lost(theta.size)
        through, factor, basis, white = found
        noise = self._noise(through, solve_triangular(factor, self.spread * white, lower=True, trans=1))
        if not np.all(np.isfinite(noise)):
            return self._lost(theta.size)
        factor = factor * self.spread
        used = np.any(candidates != 0, axis=(0, 1)) & np.any(self.slopes != 0, axis=(1, 2))
        inside = np.einsum("sct,ct->st", self.slopes[used], noise)
        denoised = self.candidate_lines[which] - self._columns(
            candidates[:, :, used], self._lines(inside, ["gregory"] * len(inside))
        )
        columns = _off(basis, solve_triangular(factor, self._rows(denoised, equation), lower=True))
        gram, slope = columns.T @ columns, columns.T @ white
        cost = float(white @ white)
        right = gram @ theta + slope
        constant = float(cost + theta @ gram @ theta + 2 * slope @ theta)
        if not (np.isfinite(constant) and np.all(np.isfinite(right)) and np.all(np.isfinite(gram))):
            return self._lost(theta.size)
        return Quadratic(cost, gram, right, constant), self.y - noise

    def _whitened(self, theta: F64, which: Any) -> tuple[F64, F64, F64, F64] | None:
        """How noise passes, the factor of its covariance, and transient and residuals whitened by it."""
        from scipy.linalg import solve_triangular

        coefficients = self.targets.copy()
        np.subtract.at(coefficients, self.equation[which], theta[:, None, None] * self.candidates[which])
        through = np.einsum("eps,sct->epct", coefficients, self.slopes, optimize=True)
        factor = self._factor(through) if np.all(np.isfinite(through)) else None
        if factor is None or not np.all(np.isfinite(factor * self.spread)):
            return None
        residual = self.target_lines.copy()
        np.subtract.at(residual, self.equation[which], theta[:, None] * self.candidate_lines[which])
        rows = self._rows(residual, range(len(self.orders))).sum(axis=1)
        solved = solve_triangular(factor * self.spread, np.column_stack([self.transient, rows]), lower=True)
        basis = np.linalg.qr(solved[:, :-1])[0]
        return through, factor, basis, _off(basis, solved[:, -1])

    def shared(self, theta: F64, other: F64) -> float:
        """Squared correlations, summed, between the whitened residuals that two estimates leave of noise."""
        from scipy.linalg import solve_triangular

        patterns = []
        for one in (theta, other):
            found = self._whitened(one, np.arange(one.size))
            if found is None:
                return 0.0
            through, factor, basis, _ = found
            rows = _off(basis, solve_triangular(factor, np.eye(len(factor)), lower=True))
            patterns.append(np.array([self._noise(through, row) for row in rows]).reshape(len(rows), -1))
        first = patterns[0] / np.maximum(self.variances, 1e-300).ravel()
        return float(np.sum((first @ patterns[1].T) ** 2))

    def colour(self, theta: F64, which: Any) -> None:
        """Weight each line by the residuals around it that θ, a fit of the candidates `which`, leaves.

        The weights of white noise leave residuals of equal size on all lines. Where other noise, or a misfit,
        makes them unequal, their mean square over neighbouring lines, a few and a part of the frequency on
        both sides, takes the place of one; what the fit takes from each line counts as degrees of freedom.
        """
        from scipy.linalg import solve_triangular

        found = self._whitened(theta, np.arange(theta.size))
        if found is None:
            return
        _, factor, basis, white = found
        columns = self._rows(self.candidate_lines[which], self.equation[which])
        columns = _off(basis, solve_triangular(factor * self.spread, columns, lower=True))
        u, size, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), False)
        free = 1 - np.sum(basis**2, axis=1) - np.sum(u[:, size > RANK * size[:1]] ** 2, axis=1)
        count, m = 2 * self.top + 1, np.arange(self.top + 1)
        near = np.abs(m[:, None] - m[None, :]) <= NEAR + PART * m[:, None]
        for e in range(len(self.orders)):
            part = slice(e * count, (e + 1) * count)
            power, freedom = (_by_line(rows[part]) for rows in (white**2, free))
            level = np.sqrt(np.maximum((near @ power) / np.maximum(near @ freedom, 1.0), ROUNDING))
            self.spread[part] *= np.concatenate([level, level[1:]])

    def _lost(self, count: int) -> tuple[Quadratic, F64]:
        lost = Quadratic(np.inf, np.eye(count), np.zeros(count), np.inf)
        return lost, self.y

    def _factor(self, through: F64) -> F64 | None:
        """Cholesky factor of the covariance of the rows; None where numbers overflow."""
        from scipy.linalg import hankel, toeplitz

        count, own, most = 2 * self.top + 1, len(self.orders), through.shape[1]
        top = self.top
        scaled = through * (self.weights * np.sqrt(self.variances))
        full = np.zeros((own * count, own * count))
        used = [[p for p in range(most) if np.any(through[e, p])] for e in range(own)]
        for e in range(own):
            for f in range(e, own):
                a = np.zeros((self.top + 1, self.top + 1), dtype=complex)
                b = np.zeros_like(a)
                for p in used[e]:
                    for q in used[f]:
                        product = np.sum(scaled[e, p] * scaled[f, q], axis=0)
                        h = self._sums(product)
                        both = self.powers[p][:, None] * self.powers[q][None, :]
                        conj = (-1) ** q * both  # s is imaginary
                        a += conj * toeplitz(h[: top + 1])
                        b += both * hankel(h[: top + 1], h[top : 2 * top + 1])
                block = np.block(
                    [
                        [(a + b).real, (b - a).imag[:, 1:]],
                        [(a + b).imag[1:], (a - b).real[1:, 1:]],
                    ]
                )
                full[e * count : (e + 1) * count, f * count : (f + 1) * count] = block / 2
                full[f * count : (f + 1) * count, e * count : (e + 1) * count] = block.T / 2
        if not np.all(np.isfinite(full)):
            return None
        size = np.diag(full).copy()
        for e in range(own):
            part = slice(e * count, (e + 1) * count)
            size[part] = np.maximum(size[part], ROUNDING * max(size[part].max(), 1e-300))
        root = np.sqrt(size)
        full = full / root[:, None] / root[None, :]
        for more in (1.0, 1e2, 1e4, 1e6):
            try:
                factor = np.linalg.cholesky(full + more * ROUNDING * np.eye(len(full)))
            except np.linalg.LinAlgError:
                continue
            return np.asarray(root[:, None] * factor)
        return None

    def _noise(self, through: F64, rows: F64) -> F64:
        """Smoothed noise (output, time) of weighted residual rows."""
        count = 2 * self.top + 1
        found = np.zeros_like(self.y)
        for e in range(len(self.orders)):
            own = rows[e * count : (e + 1) * count]
            lines = own[: self.top + 1].astype(complex)
            lines[1:] += 1j * own[self.top + 1 :]
            for p in range(through.shape[1]):
                if not np.any(through[e, p]):
                    continue
                found += through[e, p] * self._wave(self.powers[p].conj() * lines)
        return found * self.weights * self.variances

    def _sums(self, values: F64) -> C128:
        """Σ values e^(-iωt) over the samples, on lines 0 … 2 top and maybe more."""
        if self.waves is not None:
            return np.asarray(values @ self.waves)
        n = self.record.intervals
        values = values.copy()
        values[0] += values[-1]
        return np.fft.rfft(values[:-1], n)

    def _wave(self, lines: C128) -> F64:
        """Real part of Σ lines e^(iωt) at the samples, over lines 0 … top."""
        if self.waves is not None:
            return np.asarray((self.waves[:, : lines.size].conj() @ lines).real)
        n = self.record.intervals
        padded = np.zeros(n, dtype=complex)
        padded[: lines.size] = lines
        wave = np.fft.ifft(padded).real * n
        return np.append(wave, wave[0])


def _order(parts: F64) -> int:
    """Highest derivative among parts (derivative, signal); -1 of none."""
    return int(np.max(np.flatnonzero(np.any(parts != 0, axis=1)), initial=-1))


def _by_line(rows: F64) -> F64:
    """Sums over the real and the imaginary row of each line."""
    top = len(rows) // 2
    found = rows[: top + 1].copy()
    found[1:] += rows[top + 1 :]
    return found


def _off(basis: F64, columns: F64) -> F64:
    return columns - basis @ (basis.T @ columns)


def _without(transient: F64, columns: F64) -> F64:
    return _off(np.linalg.qr(transient)[0], columns) if transient.shape[1] else columns


def cost_of(lines: Sequence[Lines], theta: F64, which: Any) -> tuple[Quadratic, list[F64]]:
    """The cost of all records together, see `Lines.at`."""
    found = [one.at(theta, which) for one in lines]
    quadratic = Quadratic(
        sum(q.cost for q, _ in found),
        np.asarray(np.sum([q.gram for q, _ in found], axis=0)),
        np.sum([q.right for q, _ in found], axis=0),
        sum(q.constant for q, _ in found),
    )
    return quadratic, [y for _, y in found]


def estimate(lines: Sequence[Lines], chosen: Any, start: F64, steps: int = STEPS) -> Estimate:
    """Maximum likelihood of the chosen candidates, slopes held; curvature of all candidates."""
    at = np.flatnonzero(chosen)
    theta = np.where(chosen, start, 0.0)
    now, _ = cost_of(lines, theta, at)
    settled, rows = False, sum((2 * one.top + 1) * len(one.orders) for one in lines)
    for step in range(steps):
        move = np.zeros_like(theta)
        move[at] = _solve(now.gram, now.right - now.gram @ theta[at])
        enough = SETTLED * max(1.0, now.cost / rows)  # a misfit is noise, too
        if float(move[at] @ now.gram @ move[at]) < enough:
            settled = True
            break
        found = _lowered(lines, theta, now, move, at, enough, step < FREE)
        if found is None:
            break
        theta, now = found
    everything, smooth = cost_of(lines, theta, np.arange(theta.size))
    return Estimate(theta, everything, settled, smooth)


def _lowered(
    lines: Sequence[Lines], theta: F64, now: Quadratic, move: F64, at: Any, enough: float, free: bool
) -> tuple[F64, Quadratic] | None:
    """After a move, halved until the cost does not rise; None where it rises on the whole way."""
    trial, _ = cost_of(lines, theta + move, at)
    for _ in range(HALVINGS):
        if trial.cost <= now.cost + enough or (free and np.isfinite(trial.cost)):
            return theta + move, trial
        whole, move = trial.cost - now.cost, move / 2
        trial, _ = cost_of(lines, theta + move, at)
        if trial.cost - now.cost > max(UPHILL * whole, enough):
            return None
    return None


def _solve(gram: F64, right: F64) -> F64:
    """Least squares of a Gram matrix, columns of unit size."""
    if not right.size:
        return right
    root = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = gram / root[:, None] / root[None, :]
    return np.linalg.lstsq(scaled, right / root, rcond=1e-13)[0] / root


def signal_edge(y: F64, variances: F64, order: int, wide: int, t: F64 | None = None) -> int:
    """The highest harmonic up to `wide` at which an output (row of y) shows more than white noise.

    Lines are differenced `order` + 2 times, which takes away what the ends of the record leak. Of uneven
    samples, at times t from 0, what quadrature by the trapezoidal rule gets wrong counts as noise, too.
    """
    q, n = order + 2, y.shape[1] - 1
    top = min(wide + q + SPREAD, n // 2)
    span, turn = (n, np.arange(n + 1) / n) if t is None else (t[-1], t / t[-1])
    weights = quadrature_weights("trapezoid", n, t) / span
    noise = np.sum(weights**2 * (2 - 2 * np.cos(2 * np.pi * turn)) ** q) * variances
    power = _differenced(y, "trapezoid", top, q, t)
    quiet = np.broadcast_to(noise[:, None], power.shape)
    if t is not None:
        power = _differenced(y, "foh", top, q, t)
        quiet = quiet + np.abs(_differenced(y, "gregory", top, q, t) - power) ** 2
    width = np.ones(2 * SPREAD + 1)
    level = [
        np.convolve(own, width, "valid") / np.convolve(other, width, "valid")
        for own, other in zip(np.abs(power) ** 2, quiet, strict=True)
    ]
    loud = np.flatnonzero(np.any(np.array(level) > LOUD, axis=0))
    return int(loud[-1]) + q // 2 + 2 * SPREAD if loud.size else 0


def _differenced(y: F64, rule: str, top: int, times: int, t: F64 | None) -> C128:
    lines = core_coefficients(y, top, [rule] * len(y), [0.0] * len(y), 0, t)
    return np.asarray(np.diff(lines, times, axis=1))
