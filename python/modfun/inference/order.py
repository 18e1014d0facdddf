"""How many poles and zeros a record supports: candidates of several orders compared on the same lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import count, islice
from math import inf, isfinite, log, nan, pi
from typing import Any, Unpack

import numpy as np

from ..base import html
from ..base.arguments import public, whole
from ..base.arrays import F64
from ..base.cached import cached_property
from ..base.progress import Progress
from ..base.tables import Table
from ..errors import DataError, FitError, SpecError
from ..fitting.candidates import best_of
from ..fitting.fit import FEW_LINES, records_of
from ..fitting.single import fit_quietly
from ..fitting.undeclared import decided_by_fit, in_sentences, read_as
from ..models.options import Choices, Options
from ..models.transfer_function import TransferFunction
from ..models.transfer_words import MOST_POLES, Delay
from ..records.record import Record
from ..results.cures import STRONG, again
from ..results.derived import cancelling
from ..results.diagnosis import high_band_df
from ..results.fit import Fit
from ..results.slow_poles import drift_imitated
from ..systems.polynomials import roots_of
from . import drawing
from .common import change_of_noise, levels
from .race import Race

__all__ = ["OrderSelection", "select_order"]

CANCELS = 1.0  # standard errors; with 2, a true pair that the noise blurs is lost (docs/order.md)
MOVES = 6.0  # of the criterion, below all others: a pair that cancels moves by itself, as a drift does
MOST = 100  # numbers of poles
WORDS = {"calibrated_bic": "calibrated BIC", "bic": "BIC"}
LOOK = 1e-5  # precision of estimates that only say which band is needed


@public
@dataclass(frozen=True, eq=False, repr=False)
class OrderSelection:
    """Candidates of several orders, and the one the record supports.

    Attributes
    ----------
    table : Table
        One row per candidate, over the same lines for all: poles, zeros, unknowns (parameters and the
        transient coefficients that the order needs), cost, residual (root mean square of the weighted
        residuals, in units of the output: the report's residual norm), chi2 and p_value (cost in units of
        the noise of the high band; the p-value counts the scatter of that level), aicc, bic,
        calibrated_bic, cancelling (standard errors between the pole and the zero that are nearest to
        cancelling), stable (all poles left of the axis) and status.
    best : Fit
        The candidate with the lowest criterion, fitted by itself.
    fits : tuple of Fit
        All candidates, fitted by themselves, in the order of the table; with free delays,
        masks, a sigma, or held inputs at uneven times on the common band.
    criterion : str
        "calibrated_bic", or "bic" where the noise of the high band is not that of the fit.
    band : (float, float)
        That all candidates were compared on, rad/s.
    sigma : float
        Noise level that calibrates, of a sample of the output; nan with "bic".
    notes : tuple of str
        What was done and why, in sentences; also that the output drifts, where ``trend="linear"`` explains
        the record better.

    See Also
    --------
    modfun.select_order : Makes it.
    modfun.plot.order : Draws it.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.10.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> orders = mf.select_order(rec, poles=[1, 2, 3])
    >>> orders.best.model.order
    2
    """

    table: Table
    best: Fit
    fits: tuple[Fit, ...]
    criterion: str
    band: tuple[float, float]
    sigma: float
    notes: tuple[str, ...]

    def plot(self, *, ax: Any = None) -> Any:
        """Residual level and criterion over the number of poles; see `modfun.plot.order`."""
        chosen = self.fits.index(self.best)
        return drawing.order(self.table, self.criterion, chosen, self.sigma, ax)

    def __repr__(self) -> str:
        return "\n".join([repr(self.table), "", *self.notes])

    def _repr_html_(self) -> str:
        return self.table._repr_html_() + html.listing(self.notes)


@public
def select_order(
    data: Record | Sequence[Record],
    *,
    poles: int | Iterable[int] = range(1, 6),
    zeros: str | int | Iterable[int | tuple[int | None, ...]] = "any",
    delay: Delay | Sequence[Delay] = 0.0,
    progress: str | bool = "auto",
    **options: Unpack[Choices],
) -> OrderSelection:
    """Compare transfer functions of several orders and choose one.

    All candidates are fitted with the same number of transient terms, that of the highest order, and on
    the same lines: the report's residuals differenced alike (section 4.10), so that their costs can be
    compared. Where all inputs are held or straight between even samples each has its own number, as in
    `fit`, and costs count per real equation. With free delays, masked samples, a sigma, or held or straight
    inputs at uneven times candidates are compared by their own fits on a common band. The criterion is
    cost/sigma**2 + k log N over N real equations, k the number of parameters and poles (each pole has its
    transient coefficient), sigma the noise level of the unused high band and of the least residuals of a
    candidate that settled together, but no finer than a thousandth of the output. Where these two contradict
    each other, as with filtered noise, the criterion is N log(cost/N) + k log N.

    Parameters
    ----------
    data : Record or sequence of Record
        One output.
    poles : int or iterable of int, default 1 to 5
        Orders that the record cannot determine are left out, with a note.
    zeros : "any", int or iterable of (int or tuple), default "any"
        "any": every number below that of the poles, the same for all inputs; as many as poles, too, where
        the best of these has a pole beyond the sampling rate (an acceleration, which a force moves at once).
        Else those to try, where the poles allow them; a tuple gives one number an input (None: no path).
    delay : float or Free, or sequence of these, default 0
        Delay, s, as in `TransferFunction`: known, or estimated for each candidate (`Free` with a `max`).
    progress : {"auto", True, False}
        "auto": progress on standard error if the search takes longer than two seconds.
    **options
        Those of `fit`, method "awls" or "ml" only. With neither `band` nor `harmonics` the candidates are
        compared on the wide band of the default rule; where that is wider than the guideline for the largest
        candidate (report, eq. (20)), on what that or the candidate chosen there needs. Where they are
        compared by their own fits, on the widest band of these.

    Returns
    -------
    OrderSelection

    Raises
    ------
    SpecError
        No candidate, or an option that does not serve; several outputs.
    DataError
        Records too short for the smallest candidate.
    FitError
        No candidate could be fitted.

    See Also
    --------
    modfun.rank_test : A quick look without fits.
    modfun.OrderSelection : What it returns.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.10; G. Schwarz, Estimating the dimension
    of a model, Ann. Stat. 6, 1978.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> orders = mf.select_order(rec, poles=[1, 2, 3])
    >>> orders.best.model.order
    2

    Order and delay both unknown:

    >>> late = mf.tf([5], [1, 3, 8], delay=0.3)
    >>> rec = mf.simulate(late, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> orders = mf.select_order(rec, poles=[1, 2, 3], delay=mf.Free(max=1.0))
    >>> orders.best.model.order
    2
    """
    records = records_of(data, "select_order")
    checked = Options.checked("select_order", ("poles", "zeros", "delay", "progress"), **options)
    checked.refuse_alone("select_order")
    if checked.method not in ("awls", "ml") or checked.noise != "output":
        raise SpecError(
            f"select_order: method={checked.method!r} with noise={checked.noise!r} has residuals that do not "
            'compare; use "ml" or "awls" with noise="output"'
        )
    if len(records[0].outputs) > 1:
        outputs = records[0].outputs
        raise SpecError(
            f"select_order: the records have {len(outputs)} outputs ({', '.join(outputs)}), and orders are "
            f"compared for one at a time: rec.select(outputs=[{outputs[0]!r}])"
        )
    if checked.output_weights is not None:
        raise SpecError(
            "select_order: output_weights= weigh several outputs, and it takes one; leave them out"
        )
    structures = candidates(poles, zeros if records[0].inputs else [0], delay)
    for structure in structures:
        structure.layout(records[0].outputs, records[0].inputs)
    judged, notes = _raced(records, structures, checked, progress)
    if isinstance(zeros, str) and records[0].inputs and (far := judged.beyond_samples()):
        direct = sorted({s.poles for s in structures})
        structures += [TransferFunction(poles=n, zeros=n, delay=delay) for n in direct]
        structures.sort(key=lambda s: s.poles)  # zeros of one order stay in their order
        judged, notes = _raced(records, structures, checked, progress)
        notes = (far, *notes)
    return judged.selection(notes)


def _raced(
    records: tuple[Record, ...],
    structures: list[TransferFunction],
    options: Options,
    progress: str | bool,
) -> tuple[_Judged, tuple[str, ...]]:
    """Candidates compared on one band, and what was done for it, in sentences."""
    sought = options.band is None and options.harmonics is None
    rounds, done = 2 + sought, count(1)  # fits by themselves, a look, the comparison; one beside a drift
    with Progress(progress, "select_order", "fits") as bar:
        bar(0, rounds * len(structures) + 1)
        structures, largest, too_large = _determined(records, structures, options)
        total = rounds * len(structures) + 1
        words = decided_by_fit([records], structures, options, best_of)
        records = read_as(records, words)

        def on_candidate() -> None:
            bar(next(done), total)

        fits = []
        for structure in structures:
            known = structure is structures[-1] and not words  # the largest was fitted as it looks
            fits.append(largest if known else fit_quietly(records, structure, options))
            on_candidate()
        race = Race(records, options, structures, tuple(fits), on_candidate)
        band, least = race.wide() if sought else race.fits[-1].band, race.guideline()
        if sought and not race.apart and least < band[1]:
            look = _Judged(race, race.run(band, LOOK), band)
            band = (band[0], min(band[1], max(least, race.fits[look.best].band[1])))
        return _Judged(race, race.run(band), band), (*in_sentences(words), *too_large)


def _determined(
    records: tuple[Record, ...], structures: list[TransferFunction], options: Options
) -> tuple[list[TransferFunction], Fit, tuple[str, ...]]:
    """Candidates of orders of which the record determines the largest, its fit, a sentence about the others.

    Raises
    ------
    DataError
        Of no order.
    """
    said = ""
    largest = list({structure.poles: structure for structure in structures}.values())
    for structure in reversed(largest):
        try:
            fit = fit_quietly(records, structure, options)
        except DataError as error:
            if FEW_LINES not in str(error) or structure is largest[0]:
                raise
            said = str(error)
            continue
        if not said:
            return structures, fit, ()
        kept = structures[: structures.index(structure) + 1]
        what = said.removeprefix("fitting: ").split(";")[0]
        return kept, fit, (f"Candidates of more than {structure.poles} poles are left out: {what}.",)
    raise AssertionError("the smallest order is fitted or refused")


def candidates(
    poles: int | Iterable[int],
    zeros: str | int | Iterable[int | tuple[int | None, ...]],
    delay: Delay | Sequence[Delay],
) -> list[TransferFunction]:
    """Structures to try, smaller ones first."""
    try:
        asked = [poles] if isinstance(poles, int | np.integer) else list(islice(poles, MOST + 1))
    except TypeError:
        raise SpecError(f"select_order: poles={poles!r} must be numbers of poles, as range(1, 6)") from None
    if len(asked) > MOST:
        raise SpecError(f"select_order: poles={poles!r} has more than {MOST} numbers of poles; give fewer")
    orders = sorted({whole("select_order", "poles", n, 1, MOST_POLES) for n in asked})
    if isinstance(zeros, str) and zeros != "any":
        raise SpecError(f'select_order: zeros={zeros!r} must be "any", a number, or a list of numbers')
    made = []
    for n in orders:
        degrees: list[Any]
        if isinstance(zeros, str):
            degrees = list(range(n))
        else:
            given = [zeros] if isinstance(zeros, int) else list(zeros)
            degrees = [z for z in given if max(_degrees(z), default=0) <= n]
        made += [TransferFunction(poles=n, zeros=z, delay=delay) for z in degrees]
    if not made:
        raise SpecError(
            f"select_order: poles={poles!r} with zeros={zeros!r} leave no candidate; "
            "there are at most as many zeros as poles"
        )
    return made


def _degrees(zeros: Any) -> list[int]:
    each = zeros if isinstance(zeros, tuple | list) else [zeros]
    return [z for z in each if z is not None]


# Which one ------------------------------------------------------------------------------------------


class _Judged:
    """Candidates on one band: their costs, what follows from these, and the one chosen."""

    def __init__(self, race: Race, rows: list[dict[str, Any]], band: tuple[float, float]) -> None:
        self.race, self.rows, self.band = race, rows, band
        self.usable = np.array([row["usable"] for row in rows])
        if not self.usable.any():
            raise FitError(
                "select_order: no candidate could be fitted on the common band "
                f"({', '.join(sorted({row['status'] for row in rows}))}); "
                "give a record in which the inputs move more, or fewer poles"
            )
        self.cost = np.where(self.usable, [row["cost"] for row in rows], nan)
        params = np.array([row["theta"].size for row in rows])
        self.count = params + np.array([row["fit"].order for row in rows])
        self.free = np.array([row["df_resid"] for row in rows])
        equations = self.free + params
        self.n = n = int(equations.min())  # those of the highest order, whose transient takes the most
        self.mean = self.cost / equations
        self.fits = tuple([row["fit"] for row in rows])
        self.least = k = self._telling()
        self.high, self.sigma, self.notes = levels(rows[k], self.fits[k], race.finest())
        with np.errstate(divide="ignore", invalid="ignore"):
            self.bic = n * np.log(self.mean) + self.count * log(n)
            self.calibrated = n * self.mean / self.sigma**2 + self.count * log(n)
        self.criterion = "calibrated_bic" if isfinite(self.sigma) else "bic"
        self.score = np.where(self.usable, self.calibrated if isfinite(self.sigma) else self.bic, inf)

    def _telling(self) -> int:
        """The candidate that tells the noise level: of those that settled the one that leaves least.

        Simulations of an unstable one run away, and so does what they leave of the high band.
        """
        ranked: list[int] = np.argsort(np.where(self.usable, self.mean, inf), kind="stable").tolist()
        spread = self.race.spread()
        settled = [k for k in ranked if self.rows[k]["status"] == "ok" and self.usable[k]]
        return next((k for k in settled if not self.fits[k].high_band_sigma > spread), ranked[0])

    @cached_property
    def lowest(self) -> int:
        """The candidate of the lowest score."""
        return int(np.argmin(self.score))

    @cached_property
    def best(self) -> int:
        """The candidate of the lowest score in which no pole and zero cancel, if one comes near."""
        near = np.flatnonzero(self.score <= self.score[self.lowest] + MOVES)
        ranked = near[np.argsort(self.score[near], kind="stable")].tolist()
        return next((k for k in ranked if not self.apart(k) < CANCELS), self.lowest)

    def apart(self, k: int) -> float:
        """Standard errors between the pole and the zero of a candidate that are nearest to cancelling."""
        row = self.rows[k]
        if "apart" not in row:
            known = row["usable"]
            row["apart"] = cancelling(row["fit"], row["theta"], row["cov_nonrobust"]) if known else nan
        return row["apart"]  # type: ignore[no-any-return]

    def of_time(self) -> tuple[str, ...]:
        """That the noise changes over the records."""
        ranked = [self.best, *np.argsort(self.score, kind="stable").tolist()]
        return change_of_noise(self.fits[k] for k in ranked if isfinite(self.score[k]))

    def beyond_samples(self) -> str:
        """That the chosen candidate has a pole faster than the samples, in words.

        Such a pole is a constant in the band: b(s)/a(s) with one zero less than poles then stands for an
        input that acts on the output at once, as a force on an acceleration.
        """
        row, structure = self.rows[self.best], self.race.structures[self.best]
        fastest = float(np.max(np.abs(_poles(row))))
        rate = 2 * pi / min(float(np.min(np.diff(rec.t))) for rec in self.race.records)
        if not fastest > rate:
            return ""
        return (
            f"Candidates with as many zeros as poles were added: of those with fewer, {structure!r} was the "
            f"best, and it has a pole at {fastest:.3g} rad/s, beyond the sampling rate of {rate:.3g} rad/s. "
            "So it looks where an input acts on the output at once, as a force on an acceleration."
        )

    def drift(self) -> str:
        """That a drift of the output explains the record better than the candidates, in words."""
        for k in dict.fromkeys((self.best, self.lowest)):
            if text := drift_imitated(self.fits[k]):
                return text
        fall = self._fall()
        if not fall > STRONG:
            return ""
        return (
            f'With trend="linear", the {WORDS[self.criterion]} of the chosen candidate falls by {fall:.3g}: '
            "the output drifts."
        )

    def _fall(self) -> float:
        """By how much a drift lowers the criterion of the chosen candidate."""
        best = self.fits[self.best]
        if best.trend != "constant":
            return nan
        other: Any = again(best, best.records, best.structure, best.options.replace(trend="linear"))
        if other is None:
            return nan
        (row,) = self.race.run(self.band, fits=(other,))
        if not row["usable"]:
            return nan
        before, after = float(self.mean[self.best]), row["cost"] / (row["df_resid"] + row["theta"].size)
        if not min(before, after) > 0:
            return nan
        fall = (before - after) / self.sigma**2 if isfinite(self.sigma) else log(before / after)
        return self.n * fall - log(self.n)

    def selection(self, notes: tuple[str, ...]) -> OrderSelection:
        from scipy.special import fdtrc

        race, rows, n, best = self.race, self.rows, self.n, self.best
        with np.errstate(divide="ignore", invalid="ignore"):
            room, chi2 = n - self.count, self.cost / self.high**2
            aicc = n * np.log(self.mean) + 2 * (self.count + 1) * n / np.maximum(room - 2, 1)
        pairs = [self.apart(k) for k in range(len(rows))]
        growths = [_growth(row) if row["usable"] else nan for row in rows]
        columns = {
            "poles": [s.poles for s in race.structures],
            "zeros": [s.zeros if race.records[0].inputs else None for s in race.structures],
            "unknowns": self.count.tolist(),
            "cost": self.cost.tolist(),
            "residual": np.sqrt(self.mean).tolist(),
            "chi2": chi2.tolist(),
            "p_value": fdtrc(self.free, high_band_df(self.fits[self.least]), chi2 / self.free).tolist(),
            "aicc": np.where(room > 2, aicc, nan).tolist(),
            "bic": self.bic.tolist(),
            "calibrated_bic": self.calibrated.tolist(),
            "cancelling": [None if not isfinite(d) else d for d in pairs],
            "stable": [growth < 0 for growth in growths],
            "status": [row["status"] for row in rows],
        }
        notes = (*self.notes, *notes, *self.of_time())
        if drift := self.drift():
            notes = (f'{drift} First try mf.select_order(..., trend="linear").', *notes)
        elif not columns["stable"][best]:
            notes += (
                f"The chosen candidate is unstable: a pole has real part {growths[best]:.3g} rad/s. "
                "Right for an unstable system; else take the best of those that the table calls stable.",
            )
        return OrderSelection(
            table=Table(columns),
            best=self.fits[best],
            fits=self.fits,
            criterion=self.criterion,
            band=self.band,
            sigma=self.sigma,
            notes=(_chosen(race.structures[best], best, self.score, self.criterion, n), *notes),
        )


def _poles(row: dict[str, Any]) -> Any:
    """Those of a candidate, rad/s."""
    return roots_of(row["fit"].layout.polynomials(row["theta"])[0])


def _growth(row: dict[str, Any]) -> float:
    """Largest real part of the poles of a candidate, rad/s."""
    return float(np.max(_poles(row).real))


def _chosen(structure: TransferFunction, best: int, score: F64, criterion: str, n: int) -> str:
    others = np.delete(score, best)
    ahead = float(np.min(others) - score[best]) if others.size else inf
    lead = (
        f"{ahead:.3g} below the next"
        if ahead >= 0
        else f"{-ahead:.3g} above a candidate that was dropped because a pole and a zero of it cancel"
    )
    tail = f", {lead}" if isfinite(ahead) else ""
    return f"Chosen: {structure!r}, {WORDS[criterion]} over {n} real equations{tail}."
