"""Fits of records from a loop: what a reference explains of the inputs is the instrument."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .._core import coefficients
from ..base.arrays import F64
from ..errors import DataError, FitError, SpecError
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.corners import driving
from ..records.record import Record
from ..results.estimates import COVARIANCES
from ..results.fit import Fit

__all__ = ["explained", "referenced_fit", "refuse_reference"]

ROUNDS = 20
SETTLED = 1e-3  # of a standard error: change of a parameter that ends the rounds
STEP = 0.1  # of a standard error: differences of rounds
SLOW = 0.3  # of the change before: from there on the slopes are found anew,
BENDS = 6  # and so often at most
LOST = 1e3  # standard errors, the same: from there no round returns
LEAST = 1e-12  # variance along an axis, over the largest: rounding
BEYOND = 4  # times the highest line used: lines on which outputs follow the inputs' rest
FINE = 8  # blocks of an impulse response per period of the highest line
LONGEST = 120  # blocks
DECAYS = 14  # decay times tried, from half a block to all blocks
MOST = 0.9  # leverage of a line
MUCH = 0.8  # of an input's power in the band: references that explain so much are no reason for no estimate
SIZES = np.geomspace(1e-4, 1e6, 41)  # of the prior variance, tried


def referenced_fit(
    records: tuple[Record, ...],
    structure: Any,
    options: Options,
    fit_once: Callable[[tuple[Record, ...], Any, Options], Fit],
) -> Fit:
    """The fit whose instruments are the parts û of the inputs that references explain.

    Residuals AY − BU − T are those of a record with the inputs û and the outputs y − G(u − û), line by line.
    A fit of that record, with G from the fit before, makes residuals orthogonal to the slopes of the response
    to û, in which the noise of the loop has no part. Rounds of it end where G is that of the fit itself:
    there these are the equations of refined instrumental variables under the weights of the noise. With F
    the slope of a round's estimate by the parameters of its G, errors are (I − F)⁻¹ times those of the last
    round.

    Raises
    ------
    SpecError
        Options or a structure that do not go with a reference.
    DataError
        Records without the reference, or with uneven steps.
    FitError
        Rounds that do not settle, because noise that comes back moves the inputs too much.
    """
    names = options.reference
    refuse_reference(records, structure, options)
    inner = options.replace(reference=())
    direct = fit_once(records, structure, inner)
    if not direct.usable:
        return direct
    lasts = [hi for _, hi in direct.lines]
    parts = explained(records, names, lasts)
    rounds = _Rounds(records, parts, structure, inner, fit_once, direct)
    fit = rounds.settled(direct)
    if fit is None:
        raise FitError(_unsettled(records, structure, options, fit_once, parts, lasts))
    widened = {name: rounds.carried @ getattr(fit, name) @ rounds.carried.T for name in COVARIANCES}
    return replace(fit, options=options, records=records, instrumented=fit.records, again=fit_once, **widened)


def _unsettled(
    records: tuple[Record, ...],
    structure: Any,
    options: Options,
    fit_once: Callable[[tuple[Record, ...], Any, Options], Fit],
    parts: Sequence[F64],
    lasts: Sequence[int],
) -> str:
    """Why rounds do not settle, by what the references explain, and whether weights of the lines cure it."""
    found = _shares(records, parts, lasts)
    shares = [
        f"{100 * share:.3g} % of {name}"
        for share, name in zip(found.tolist(), records[0].inputs, strict=True)
        if name not in options.reference
    ]
    why = "though the reference explains"
    if not min(found) > MUCH:
        why = "since the reference explains too little of the inputs,"
    told = f"fit: reference={', '.join(options.reference)!r}: the estimate did not settle, {why} "
    told += ", ".join(shares)
    weighted, either = options.replace(noise="coloured", output_weights=None), ""
    if options.noise == "output":
        try:
            if referenced_fit(records, structure, weighted, fit_once).success:
                return f'{told}; with weights of the noise spectrum it does: add noise="coloured"'
        except FitError:
            either = ', nor with noise="coloured"'
    return f"{told}{either}; take one that moves them more, a longer record, or fewer poles"


def _shares(records: Sequence[Record], parts: Sequence[F64], lasts: Sequence[int]) -> F64:
    """What references explain of the variance of each input, on the lines up to the last ones of a fit."""
    rest = whole = np.zeros(len(parts[0]))
    for rec, own, last in zip(records, parts, lasts, strict=True):
        u = driving(rec)
        for_each = [
            np.sum(np.abs(np.fft.rfft(x[:, :-1])[:, 1 : last + 1]) ** 2, axis=1) for x in (u - own, u)
        ]
        rest, whole = rest + for_each[0], whole + for_each[1]
    return np.asarray(1 - rest / np.maximum(whole, np.finfo(float).tiny)).clip(0.0)


def refuse_reference(records: Sequence[Record], structure: Any, options: Options) -> None:
    """Refuse options, a structure or records that do not go with a reference."""
    given = ", ".join(options.reference)
    alone = options.noise in ("output", "coloured") and options.initial_state == "unknown"
    able = isinstance(structure, TransferFunction) and options.method in ("ml", "awls")
    if not (able and alone and records[0].inputs):
        raise SpecError(
            f'fit: reference={given!r} is for transfer functions with inputs, by "ml" or "awls" in white or '
            "coloured noise of the outputs, from unknown initial states; leave the other option out"
        )
    if {*records[0].inputs} <= {*options.reference}:
        raise SpecError(
            f"fit: reference={given!r}: no input is left that it explains; the reference of a loop is its "
            "command, from outside; if the inputs have no noise of the outputs in them, leave reference= out"
        )
    for k, rec in enumerate(records):
        for name in options.reference:
            if name not in rec.kept and name not in rec.inputs:
                raise DataError(
                    f"fit: reference={given!r}, but record {k} keeps no channel {name!r} (it has "
                    f"{', '.join(rec.channels)}); make it with mf.Record(..., keep={{{name!r}: samples}})"
                )
            if np.ptp(rec[name]) == 0:
                raise DataError(f"fit: reference {name!r} stands still in record {k}, so it explains nothing")
        if rec.dt is None or rec.mask is not None or rec.sigma is not None:
            raise DataError(
                f"fit: reference={given!r} takes evenly sampled records without masks and sigma; record {k} "
                "is none, resample it or leave these out"
            )


class _Rounds:
    """Fits of records with the inputs' explained parts, each with the response of the one before."""

    def __init__(
        self, records: Any, parts: Sequence[F64], structure: Any, options: Options, fit_once: Any, direct: Any
    ) -> None:
        self.records, self.parts, self.structure = records, parts, structure
        self.options, self.fit_once = options, fit_once
        self.layout, self.intervals = direct.layout, direct.intervals
        self.tops = [
            min(BEYOND * hi, (n - 1) // 2) for (_, hi), n in zip(direct.lines, direct.intervals, strict=True)
        ]
        self.carried = np.eye(direct.params.size)

    def settled(self, fit: Fit) -> Fit | None:
        """The fit at which a round changes nothing; None where there is none."""
        params: F64 = fit.params
        far, anew = np.inf, 0
        for k in range(ROUNDS):
            fit = self.after(params)
            if not (fit.usable and fit.success) or (k and far > LOST):
                return None
            step = fit.params - params
            before, far = far, float(np.max(np.abs(step) / self._sizes(fit)))
            if k == 0:  # the band is chosen once
                edges = (fit.band[0], fit.band[1] * (1 + 1e-9))
                self.options = self.options.replace(band=edges, harmonics=None)
            elif k == 1 or far > max(SLOW * before, SETTLED):  # anew where it bends
                if (anew := anew + 1) > BENDS:
                    return None
                self.carried = np.asarray(np.linalg.pinv(np.eye(params.size) - self._slopes(params, fit)))
            if k and far < SETTLED:
                return fit
            params = params + self.carried @ step if k else fit.params
        return None

    def after(self, params: F64) -> Fit:
        """One round: the fit with the response of these parameters."""
        moved = tuple(
            rec._like(u=own, y=self._moved(k, params))
            for k, (rec, own) in enumerate(zip(self.records, self.parts, strict=True))
        )
        made: Fit = self.fit_once(moved, self.structure, self.options)
        return made

    def _slopes(self, params: F64, fit: Any) -> F64:
        """Slopes of a round's estimate by the parameters of its response.

        Along the axes of their covariance: one parameter alone, moved by its standard error, is far from all
        that a record allows where estimates go together, and the response bends on the way.
        """
        free = np.flatnonzero(np.isfinite(self._sizes(fit)))
        sizes = fit.bse[free]
        spread, axes = np.linalg.eigh(
            np.asarray(fit.cov_params())[np.ix_(free, free)] / np.outer(sizes, sizes)
        )
        ways = sizes[:, None] * axes * np.sqrt(np.maximum(spread, LEAST * spread[-1]))
        moved = np.zeros((params.size, free.size))
        for j, way in enumerate(ways.T):
            beside = params.copy()
            beside[free] += STEP * way
            other = self.after(beside)
            if other.usable:
                moved[:, j] = (other.params - fit.params) / STEP
        found = np.zeros((params.size, params.size))
        found[:, free] = moved @ np.linalg.inv(ways)
        return found

    @staticmethod
    def _sizes(fit: Any) -> F64:
        """Standard errors; infinite for what is on its bound."""
        return np.asarray(np.where(fit.bse > 0, fit.bse, np.inf))

    def _moved(self, k: int, params: F64) -> F64:
        """Outputs of a record less the periodic response to the inputs' rest, over the window of the fit."""
        rec, n, top = self.records[k], self.intervals[k], self.tops[k]
        rest, y = np.ascontiguousarray(driving(rec) - self.parts[k]), rec.y.copy()
        rules = [self.options.rule if kind == "smooth" else kind for kind in rec.intersample]
        start = rec.intervals - n
        s = 2j * np.pi / (n * rec.dt) * np.arange(top + 1)
        for i in range(len(y)):
            late = [delay / rec.dt for delay in self.layout.delays(params, i)]
            lines = coefficients(rest, top, rules, late, start, None)
            den, nums = self.layout.polynomials(params, i)
            with np.errstate(all="ignore"):
                response = np.array([np.polyval(num, s) for num in nums]) / np.polyval(den, s)
            whole = np.sum(response * lines, axis=0)
            whole[0] = whole[0].real if np.isfinite(whole[0]) else 0.0  # an integrator has no line 0
            own = np.fft.irfft(np.append(whole, np.zeros(n // 2 - top)), n) * n
            y[i, start:] -= np.append(own, own[0])
        return np.asarray(y)


# What a reference explains -----------------------------------------------------------------------


def explained(records: Sequence[Record], names: Sequence[str], tops: Sequence[int]) -> list[F64]:
    """Part of each record's inputs that references explain, (input, time).

    Impulse responses from the references to each input, in blocks that resolve the highest line (`tops`, one
    per record) of the band, by least squares on the lines up to twice that. Their prior is that of stable
    spline kernels: covariance c exp(−max(j, k)/τ) of blocks j and k, but for the first block, which is free;
    c and τ maximise the marginal likelihood (G. Pillonetto, G. De Nicolao, Automatica 46, 2010). Each line is
    predicted from the others (J. D. Angrist, G. W. Imbens, A. B. Krueger, J. Appl. Econometrics 14, 1999):
    the part of its noise that it would put into its own instrument biases.
    """
    block = [max(1, rec.intervals // (FINE * top)) for rec, top in zip(records, tops, strict=True)]
    seconds = min(own * rec.dt for own, rec in zip(block, records, strict=True))  # type: ignore[operator]
    block = [max(1, round(seconds / rec.dt)) for rec in records]  # type: ignore[operator]
    count = min(
        LONGEST, max(4, min(rec.intervals // (2 * own) for rec, own in zip(records, block, strict=True)))
    )
    scales = [max(float(np.std(rec[name])) for rec in records) for name in names]
    lasts = [min(2 * top, rec.intervals // 2) for rec, top in zip(records, tops, strict=True)]

    def past(rec: Record, own: int) -> Any:
        for name, scale in zip(names, scales, strict=True):
            yield from _blocks(rec[name] / scale, own, count)

    rows = [
        np.vstack([_real(row, last) for row in past(rec, own)])
        for rec, own, last in zip(records, block, lasts, strict=True)
    ]
    a, parts = np.hstack(rows).T, [rec.u.copy() for rec in records]
    ends = np.cumsum([0, *(row.shape[1] for row in rows)])
    for j, name in enumerate(records[0].inputs):
        if name in names:  # it is a reference itself
            continue
        b = np.concatenate([_real(rec.u[j], last) for rec, last in zip(records, lasts, strict=True)])
        taps, leverage = _response(a, b, len(names))
        for part, rec, own, first, last in zip(parts, records, block, ends, lasts, strict=False):
            part[j] = sum(h * row for h, row in zip(taps, past(rec, own), strict=True))
            left = rec.u[j] - part[j]
            lines = np.fft.rfft(left[:-1])
            # Without what each line contributed to its own prediction, as it did with its noise.
            of_line = leverage[first : first + 2 * last].reshape(2, last).mean(axis=0).clip(0.0, MOST)
            gain = np.zeros(lines.size)
            gain[1 : last + 1] = of_line / (1 - of_line)
            own_lines = np.fft.irfft(gain * lines, left.size - 1)
            part[j] += left.mean() - np.append(own_lines, own_lines[0])
    return parts


def _blocks(r: F64, own: int, count: int) -> Any:
    """Means of r over blocks of samples, from the present one back; before the record it stood still."""
    total = np.concatenate([np.zeros(count * own), np.cumsum(r - r[0])])
    for k in range(count):
        first = (count - k) * own
        yield (total[first : first + r.size] - total[first - own : first - own + r.size]) / own


def _real(row: F64, last: int) -> F64:
    """Lines 1 to `last` of samples, real and imaginary parts."""
    lines = np.fft.rfft(row[:-1])[1 : last + 1] / row.size
    return np.concatenate([lines.real, lines.imag])


def _response(a: F64, b: F64, references: int) -> tuple[F64, F64]:
    """Blocks of the impulse responses from rows a (row, reference x block) to b (row,), and leverages."""
    count = a.shape[1] // references
    free = np.arange(references) * count
    rest = np.delete(np.arange(a.shape[1]), free)
    basis = np.linalg.qr(a[:, free])[0]
    side = b - basis @ (basis.T @ b)
    q, left = np.linalg.qr(a[:, rest] - basis @ (basis.T @ a[:, rest]))
    norm, side = float(side @ side), q.T @ side
    freedom = len(b) - references
    k = np.arange(1, count)
    best, found, leverage = np.inf, np.zeros(rest.size), np.zeros(len(b))
    for tau in np.geomspace(0.5, count, DECAYS):
        prior = np.linalg.cholesky(np.exp(-np.maximum.outer(k, k) / tau) + 1e-12 * np.eye(count - 1))
        own = np.hstack([left[:, i * (count - 1) : (i + 1) * (count - 1)] @ prior for i in range(references)])
        u, s, v = np.linalg.svd(own, full_matrices=False)
        c = u.T @ side
        share = SIZES[:, None] * (s / s[0]) ** 2
        level = (norm - (share / (1 + share)) @ c**2) / freedom
        loss = freedom * np.log(np.maximum(level, 1e-300)) + np.sum(np.log1p(share), axis=1)
        at = int(np.argmin(loss))
        if loss[at] < best:
            best = float(loss[at])
            kept = share[at] / (1 + share[at])
            white, leverage = v.T @ (kept * c / s), (q @ u) ** 2 @ kept
            found = np.concatenate([prior @ own_part for own_part in np.split(white, references)])
    taps = np.zeros(a.shape[1])
    taps[rest] = found
    taps[free] = np.linalg.lstsq(a[:, free], b - a[:, rest] @ found, rcond=None)[0]
    return taps, leverage + np.sum(basis**2, axis=1)
