"""Tests of further columns: what a response, powers of the output, a drift or an event would explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, isnan, log, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._core import coefficients, line_event
from ..base.arrays import C128, F64
from ..errors import ModfunError
from ..records.corners import driving
from .estimates import Estimates
from .fitted_samples import begins, fitted, stationary
from .followers import in_loop
from .gradients import response_gradients

__all__ = [
    "Explained", "Residual", "basis_of", "event", "event_p", "fitted_lines", "further", "simulated",
    "testable",
]  # fmt: skip

DEGREES = 4  # powers of i*omega that an unexplained response to an input is made of
STEEPEST = 4.0  # slope of the noise's log power over log frequency that the test allows for
SHARES = np.append(0.0, 1 - np.logspace(-4, -0.05, 30)[::-1])  # of noise that drives the system
LARGE = 1e100  # a simulated output beyond it is that of an unstable model and explains nothing
BESIDE = 16  # samples on either side of one that show how strong the noise is there
ODD = 0.01  # p-value below which it is asked whether there is a loop
SAME = 1e-3  # columns closer to the fitted ones, or to one another, are the same


@dataclass(frozen=True)
class Explained:
    """What further columns explain of the residual lines of one output.

    Attributes
    ----------
    what : {"response", "gain", "power", "change", "drift", "event", "spike"}
        What the columns are: a further response to an input, powers of an input and the input clipped,
        powers of the simulated output and its rate, coefficients that change in time, a slope and a bend
        of the output, one event at one time, one sample.
    channel : str
        The input of a response or a gain, else the output.
    output : int
        Position of the output.
    p_value : float
        Of an F test, allowing for noise whose log power is a straight line over log frequency, and for noise
        that drives the system; of a gain, a power or a change in a loop also for noise of the residuals' own
        spectrum. Of an event Fisher's. Small: the columns belong to the residuals.
    bic : float
        By how much a fit with these columns would lower N log(cost/N) + p log N; positive: it pays.
    time, record : float, int
        Of an event or a spike, s on the clock of the record at this position; else nan.
    """

    what: str
    channel: str
    output: int
    p_value: float
    bic: float
    time: float = nan
    record: int = 0


def further(fit: Estimates, enough: float = 1.0) -> tuple[Explained, ...]:
    """All tests of further columns that there is something to say about; see `Explained`.

    All but that of events need transfer functions in white output noise and even, unmasked samples. Where
    the p-value in white noise is above `enough`, which that in noise of any slope only raises, it stands.
    """
    found: list[Explained] = []
    if testable(fit):
        whole = [simulated(fit, k) for k in range(len(fit.pieces))]
        for i in range(len(fit.outputs)):
            found += _of_output(fit, i, whole, enough)
    if (short := event(fit)) is not None:
        found.append(short)
    return tuple(found)


def _of_output(fit: Estimates, i: int, simulated: Sequence[F64 | None], enough: float) -> list[Explained]:
    """All tests of one output."""
    y = fit.outputs[i]
    blocks = [_Block.of(fit, k, i, whole) for k, whole in enumerate(simulated)]
    lines = Residual.of(blocks, enough)
    found = []
    for k, name in enumerate(fit.inputs):
        found.append(lines.response(name, [b.responses(k) for b in blocks]))
        found.append(_of_loop(lines.tested("gain", name, [b.gains(k) for b in blocks]), blocks, lines))
    found.append(_of_loop(lines.tested("power", y, [b.powers() for b in blocks]), blocks, lines))
    found.append(_of_loop(lines.tested("change", y, [b.changes() for b in blocks]), blocks, lines))
    if fit.trend == "constant":
        found.append(lines.tested("drift", y, [b.drifts() for b in blocks]))
    return found + _spikes(fit, i, simulated)


def _of_loop(one: Explained, blocks: Sequence[_Block], lines: Residual) -> Explained:
    """The test; in a loop with the larger of its p-value and that in noise of the residuals' own spectrum.

    Inputs of a loop hold the noise, and so do powers of them. Only what acts later than the noise of its own
    sample tells, weighted by the spectrum of this noise (L. Ljung, System Identification, 1999, section
    13.4): in white noise linear plants under slow loads had p-values down to 1e-13.
    """
    fit = blocks[0].fit
    if not one.p_value < ODD or fit.spectrum is None or not in_loop(fit):
        return one
    omega, power, _ = fit.spectrum
    height = -0.5 * np.log(np.maximum(power[one.output], np.finfo(float).tiny))
    at = [np.tile(b.m * fit.omega0[b.record], 2) for b in blocks]
    weight = np.exp(np.interp(np.concatenate(at), omega, height))
    if one.what == "gain":
        columns = [b.gains(fit.inputs.index(one.channel), later=True) for b in blocks]
    else:
        columns = [b.powers() if one.what == "power" else b.changes() for b in blocks]
    return replace(one, p_value=max(one.p_value, lines.weighted(columns, weight)))


def simulated(fit: Estimates, k: int) -> F64 | None:
    """Simulated outputs over what was fitted of a record.

    None where they leave the range of floats, and of equations that leave measured signals open.
    """
    rec = fitted(fit)[k]
    try:
        with np.errstate(all="ignore"):
            return fit.simulate(rec)[0][:, rec.intervals - fit.intervals[k] :]
    except ModfunError:
        return None


def testable(fit: Estimates) -> bool:
    """Whether residuals can be tested in time: transfer functions in white noise, even, unmasked samples."""
    return (
        bool(fitted(fit))
        and fit.layout.rational
        and fit.options.noise == "output"
        and fit.options.method in ("awls", "ml")
        and all([level > 0 for level in fit.noise_cov.diagonal().tolist()])
        and stationary(fit)
        and all(rec.dt is not None for rec in fitted(fit))
    )


def fitted_lines(fit: Estimates, i: int) -> tuple[F64, F64, NDArray[np.intp]]:
    """Residual lines of an output, real parts first, record by record, with the ends of these.

    Between them orthonormal columns (part, column) that span what was fitted to the lines.
    """
    one = Residual.of([_Block.of(fit, k, i, None) for k in range(len(fitted(fit)))])
    return one.e, one.basis, one.ends


def event(fit: Estimates) -> Explained | None:
    """The most likely time at which one short event explains residual lines, with Fisher's p-value.

    Lines of stationary noise have phases of their own, whatever its colour; an event at a time t turns them
    by exp(-i omega t) together.
    """
    found = _likeliest(fit)
    if found is None:
        return None
    p, i, k, at, share = found
    lines = fit.pieces[k].shape[1]
    time = begins(fit)[k] + at / (4 * lines) * 2 * np.pi / fit.omega0[k]
    gain = -2 * lines * log(max(1 - share, 1e-300)) - 3 * log(2 * lines)
    return Explained("event", fit.row_names[i], i, p, gain, time, k)


def event_p(fit: Estimates) -> float:
    """The p-value of `event`, without what nobody reads at every fit; nan where there is none."""
    found = _likeliest(fit)
    return nan if found is None else found[0]


def _likeliest(fit: Estimates) -> tuple[float, int, int, int, float] | None:
    """Of the event: p-value, output, record, place on a grid of four times the lines, share of the power."""
    best: tuple[float, int, int, int, float] | None = None
    if not stationary(fit):
        return best
    rows = len(fit.row_names)
    for i in range(rows):
        for k, piece in enumerate(fit.pieces):
            found = line_event(piece[i])
            if found is None:
                continue
            (at, share), lines = found, piece.shape[1]
            # Fisher's g over as many times as lines; a grid four times finer finds as much as thrice as many.
            p = min(1.0, 3 * lines * len(fit.pieces) * rows * (1 - share) ** (lines - 1))
            if best is None or p < best[0]:
                best = p, i, k, at, share
    return best


def _spikes(fit: Estimates, i: int, simulated: Sequence[F64 | None]) -> list[Explained]:
    """The sample that is farthest from the simulated output, by the law of the largest of normal numbers."""
    from scipy.special import ndtr

    found = []
    for k, (rec, whole) in enumerate(zip(fitted(fit), simulated, strict=True)):
        if whole is None:
            continue
        first = rec.intervals - fit.intervals[k]
        e = rec.y[i, first:] - whole[i]
        far = np.abs(e - np.median(e))
        at = int(np.argmax(far))
        near = far[max(at - BESIDE, 0) : at + BESIDE + 1]  # noise may change in time
        usual = 1.4826 * max(float(np.median(far)), float(np.median(near)))
        beside = float(np.max(np.delete(far[max(at - 1, 0) : at + 2], min(at, 1)), initial=0.0))
        if not 0 < usual < LARGE or 2 * beside > far[at]:  # what lasts is no spike
            continue
        p = min(1.0, 2 * far.size * len(fitted(fit)) * float(ndtr(-far[at] / usual)))
        share = min(float(far[at] ** 2 / np.sum(far**2)), 1 - 1e-9)
        gain = -far.size * log(1 - share) - 2 * log(far.size)
        found.append(Explained("spike", fit.outputs[i], i, p, gain, float(rec.t[first + at]), k))
    return found


@dataclass(frozen=True)
class _Block:
    """One record, one output: residual lines, and the columns that were fitted to them, all whitened."""

    fit: Estimates
    record: int
    output: int
    m: F64
    residual: C128
    fitted: C128
    own: C128
    inputs: C128
    late: C128
    response: C128
    over: C128
    deviation: F64
    simulated: F64  # about its mean, in units of its range; zeros where there is none

    @classmethod
    def of(cls, fit: Estimates, k: int, i: int, simulated: F64 | None) -> _Block:
        rec, (lo, hi) = fitted(fit)[k], fit.lines[k]
        m = np.arange(lo, hi + 1, dtype=np.float64)
        s = 1j * m * fit.omega0[k]
        delays = np.array(fit.layout.delays(fit.params, i)).reshape(-1)
        u = _lines(fit, k, driving(rec, fit.options.rule), rec.intersample, delays / rec.dt)
        response, slopes = response_gradients(fit.layout, fit.params, m * fit.omega0[k])
        late = np.exp(s * delays[:, None])  # the delays are in the coefficients of the inputs
        den, _ = fit.layout.polynomials(fit.params, i)
        over: C128 = np.asarray(1 / np.polyval(den, s), dtype=np.complex128)
        unit = 1j * m / max(hi, 1)
        own = [unit**j * over for j in range(den.size - 1)]
        if fit.trend == "linear":
            own.append(_ramp(m))
        h = np.where(m == 0, 1.0, 0.5)
        deviation = float(fit.noise_levels[k, i]) * np.sqrt(h / fit.intervals[k])
        return cls(
            fit, k, i, m, fit.pieces[k][i] * _turn(fit, over),
            np.einsum("pkf,kf->pf", slopes[:, i], u * late) / deviation,
            _complex(own).reshape(-1, m.size) / deviation,
            u, late, response[i], over, deviation, _centred(simulated, i, fit.intervals[k] + 1),
        )  # fmt: skip

    def responses(self, k: int) -> C128:
        """Any smooth response to an input, and more delay."""
        unit, u = 1j * self.m / max(float(self.m[-1]), 1.0), self.inputs[k]
        delay = unit * self.response[k] * self.late[k] * u
        columns = [*(unit**j * u for j in range(DEGREES)), delay]
        return _complex(columns) / self.deviation

    def powers(self) -> C128:
        """Powers of the output, and what these and those of its rate would add to the equation."""
        y = self.simulated
        rate = np.gradient(y)
        rate /= float(np.max(np.abs(rate))) or 1.0
        found = self._spectra(np.vstack([y**2, y**3, rate * np.abs(rate)]))
        return np.concatenate([found[:2], found * self.over])

    def gains(self, k: int, *, later: bool = False) -> C128:
        """Powers of an input and the input clipped at its rms, and what they would add to the equation.

        `later`: behind the response, not as they are.
        """
        rec = fitted(self.fit)[self.record]
        u = rec.u[k, rec.intervals - self.fit.intervals[self.record] :]
        u = (u - u.mean()) / (float(np.ptp(u)) or 1.0)
        rms = float(np.sqrt(np.mean(u**2)))  # a stop: what an actuator does not pass
        found = self._spectra(_bent(np.vstack([u**2, u**3, u.clip(-rms, rms)]), u)) * self.late[k].conj()
        first = found * (self.response[k] * self.late[k]) if later else found
        return np.concatenate([first, found * self.over])

    def changes(self) -> C128:
        """What coefficients that change in time would add to the equation."""
        y = self.simulated
        time = np.linspace(-1.0, 1.0, y.size)
        return self._spectra(np.vstack([time * y, time * np.gradient(y)])) * self.over

    def drifts(self) -> C128:
        """A slope and a bend."""
        time = np.linspace(-1.0, 1.0, self.fit.intervals[self.record] + 1)
        return self._spectra(np.vstack([time, time**2]))

    def _spectra(self, rows: F64) -> C128:
        full = np.zeros((len(rows), fitted(self.fit)[self.record].t.size))
        full[:, full.shape[1] - rows.shape[1] :] = rows
        kinds = ["smooth"] * len(rows)
        return _lines(self.fit, self.record, full, kinds, np.zeros(len(rows))) / self.deviation


def _bent(rows: F64, u: F64) -> F64:
    """What rows are beside a straight line over u; zeros where that is nothing, as of two levels."""
    line = np.vstack([np.ones(u.size), u])
    left: F64 = rows - np.linalg.lstsq(line.T, rows.T, rcond=None)[0].T @ line
    left[np.abs(left).max(axis=1) <= SAME * np.abs(rows).max(axis=1)] = 0.0
    return left


def _turn(fit: Estimates, over: C128) -> C128 | float:
    """What turns whitened residuals of the equation, divided by the size of A alone, into the output's.

    Outputs with denominators of their own are whitened together, and have their phases already.
    """
    return over / np.abs(over) if fit.layout.common or len(fit.outputs) == 1 else 1.0


def _centred(simulated: F64 | None, i: int, count: int) -> F64:
    if simulated is None or not np.all(np.abs(simulated[i]) < LARGE):
        return np.zeros(count)
    y: F64 = simulated[i]
    return np.asarray((y - y.mean()) / (float(np.ptp(y)) or 1.0))


def _ramp(m: F64) -> C128:
    """Lines of a straight line, up to the constant that the transient holds."""
    return np.asarray(np.where(m == 0, 0j, 1 / np.where(m == 0, 1.0, 1j * m)))


def _lines(fit: Estimates, k: int, rows: F64, kinds: Sequence[str], late: F64) -> C128:
    """Fourier coefficients of rows (row, time) of a record over the lines of the fit."""
    rec, (lo, hi) = fitted(fit)[k], fit.lines[k]
    rules = [fit.options.rule if kind == "smooth" else kind for kind in kinds]
    if not len(rows):
        return np.zeros((0, hi + 1 - lo), complex)
    start = rec.intervals - fit.intervals[k]
    return coefficients(np.ascontiguousarray(rows), hi, rules, late.tolist(), start, None)[:, lo:]


def _complex(rows: Sequence[Any]) -> C128:
    return np.array(rows, dtype=np.complex128)


def _real(rows: C128) -> F64:
    return np.concatenate([rows.real, rows.imag], axis=-1)


class _Tested(NamedTuple):
    """One test: p-value, part of the residuals' power, columns; what is left of rows, and their freedom."""

    p_value: float
    share: float
    columns: int
    rest: F64
    free: F64


@dataclass(frozen=True)
class Residual:
    """The residual lines of one output over all records, real parts first, and what was fitted to them."""

    output: int
    nuisance: F64
    e: F64
    x: F64  # logarithm of the frequency
    driven: F64  # spectrum of noise that drives the system, of mean 1
    ends: NDArray[np.intp]  # of the records
    basis: F64  # of the nuisance, unweighted
    enough: float  # p-value in white noise above which the slope of the noise is not asked for

    @classmethod
    def of(cls, blocks: Sequence[_Block], enough: float = 1.0) -> Residual:
        ends = np.cumsum([0, *(2 * b.m.size for b in blocks)])
        nuisance = np.zeros((len(blocks[0].fitted) + sum(len(b.own) for b in blocks), ends[-1]))
        at = len(blocks[0].fitted)
        for block, (first, last) in zip(blocks, pairwise(ends), strict=True):
            nuisance[: len(block.fitted), first:last] = _real(block.fitted)
            nuisance[at : at + len(block.own), first:last] = _real(block.own)
            at += len(block.own)
        e = np.concatenate([_real(b.residual) for b in blocks])
        x = np.concatenate([np.tile(np.log(b.m + 1.0), 2) for b in blocks])
        driven = np.concatenate([np.tile(np.abs(b.over / b.deviation) ** 2, 2) for b in blocks])
        driven /= driven.mean()
        return cls(blocks[0].output, nuisance, e, x, driven, ends, basis_of(nuisance), enough)

    def response(self, channel: str, columns: Sequence[C128]) -> Explained:
        """The likelier of any further response and of more delay alone, which is missing most often."""
        every = self.tested("response", channel, columns)
        delay = self.tested("response", channel, [rows[-1:] for rows in columns])
        best = delay if delay.p_value < every.p_value or isnan(every.p_value) else every
        return replace(best, p_value=min(1.0, 2 * best.p_value))

    def tested(self, what: str, channel: str, columns: Sequence[C128]) -> Explained:
        """F test of columns beside the fitted ones: the largest p in white, in steep and in driving noise."""
        tested = np.concatenate([_real(extra) for extra in columns], axis=-1)
        white = self._within(tested, np.ones(self.e.size))
        if white is None:
            return Explained(what, channel, self.output, nan, -inf)
        worst = white.p_value
        for shape in (self._steep, self._driving) if worst <= self.enough else ():
            found: _Tested | None = white
            for _ in range(2):  # in which a shape settles
                found = found and self._within(tested, shape(found.rest, found.free), more=1)
            if found is None:
                return Explained(what, channel, self.output, nan, -inf)
            worst = max(worst, found.p_value)
        tall = self.e.size
        gain = -tall * log(max(1 - white.share, 1e-300)) - white.columns * log(tall)
        return Explained(what, channel, self.output, worst, gain)

    def weighted(self, columns: Sequence[C128], weight: F64) -> float:
        """p-value of columns beside the fitted ones, with rows weighted by numbers of the residuals."""
        found = self._within(np.concatenate([_real(rows) for rows in columns], axis=-1), weight, more=1)
        return 1.0 if found is None else found.p_value

    def _within(self, tested: F64, weight: F64, more: int = 0) -> _Tested | None:
        """The test with rows so weighted, by `more` numbers of residuals; None where nothing is left."""
        from scipy.special import fdtrc

        basis = basis_of(self.nuisance * weight) if more else self.basis
        new = tested * weight
        size = np.linalg.norm(new, axis=1)
        new = (new - (new @ basis) @ basis.T)[size > 0] / size[size > 0, None]
        left, s, _ = np.linalg.svd(new.T, full_matrices=False)
        left = left[:, s > SAME]
        whole = self.e * weight - basis @ (basis.T @ (self.e * weight))
        part = left.T @ whole
        rest = whole - left @ part
        count, free = left.shape[1], self.e.size - basis.shape[1] - left.shape[1] - more
        if count == 0 or free < 2:
            return None
        remaining, found = float(rest @ rest), float(part @ part)
        ratio = found / count / (remaining / free) if remaining > 0 else inf
        of_rows = 1 - np.sum(basis**2, axis=1) - np.sum(left**2, axis=1)
        share = found / (float(whole @ whole) or 1.0)
        return _Tested(float(fdtrc(count, free, ratio)), share, count, rest / weight, of_rows)

    def _steep(self, rest: F64, free: F64) -> F64:
        """Weights of noise whose log power is a straight line over log frequency, from what is left of lines.

        `free`: degrees of freedom that are left of each part of a line.
        """
        from scipy.special import digamma, polygamma

        own = self._of_lines(free).clip(1e-6)
        power = self._of_lines(rest**2) / own
        height = np.log(np.maximum(power, 1e-12 * power.max() + 1e-300)) - digamma(own / 2) + np.log(own / 2)
        trust = 1 / polygamma(1, own / 2)
        place = self.x - trust @ self.x / trust.sum()
        spread = float(trust @ place**2)
        slope = float(trust @ (place * height)) / spread if spread > 0 else 0.0
        slope *= max(0.0, 1 - 2 / (spread * slope**2)) if slope else 0.0  # what chance makes of it
        return np.asarray(np.exp(-0.5 * float(np.clip(slope, -STEEPEST, STEEPEST)) * place))

    def _driving(self, rest: F64, free: F64) -> F64:
        """Weights of noise that drives the system beside white noise, by the likeliest share of either."""
        own = self._of_lines(free).clip(1e-6)
        power = self._of_lines(rest**2) / own
        shapes = SHARES[:, None] * self.driven + (1 - SHARES)[:, None]
        level = (power / shapes) @ own / own.sum()
        unlikely = np.log(shapes) @ own + own.sum() * np.log(np.maximum(level, 1e-300))
        best = int(np.argmin(unlikely))
        if unlikely[0] - unlikely[best] < 2:  # chance does that
            best = 0
        return np.asarray(1 / np.sqrt(shapes[best]))

    def _of_lines(self, values: F64) -> F64:
        """Sums over the real and the imaginary part of each line, twice."""
        halves = [values[a:b].reshape(2, -1).sum(axis=0) for a, b in pairwise(self.ends)]
        return np.concatenate([np.tile(half, 2) for half in halves])


def basis_of(rows: F64) -> F64:
    """Orthonormal columns that span the rows."""
    size = np.linalg.norm(rows, axis=1)
    kept: Any = rows[size > 0] / size[size > 0, None]
    q: F64 = np.linalg.qr(kept.T)[0] if len(kept) else np.zeros((rows.shape[1], 0))
    return q
