"""Which terms an equation has: a library of candidates, and those that the records support."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np

from ..base import html
from ..base.arguments import public
from ..base.arrays import F64
from ..base.tables import Table
from ..equations.equation import Equation
from ..errors import DataError, FitError, ModfunError, SpecError
from ..fitting.fit import fit_quietly, records_of
from ..models.noise import Noise
from ..models.options import Options
from ..records.record import Record
from ..records.samples import refuse_own_noise
from ..results.fit import Fit
from . import drawing_terms
from .library import Library, library_of
from .moments import Lines, signal_edge
from .term_search import FALSE_ALARM, Search, Searched, weights

__all__ = ["TermSelection", "select_terms"]

LARGER = 3  # sizes beyond the chosen one that the path shows
ALIKE = 6.0  # rise of the criterion at an exchange, under which two terms are not told apart
FAR = 4.0  # standard deviations of a residual variance that contradicts the noise level
SILENT = 1e-9  # least noise level, over the size of a channel
LIKELY = 0.01  # least probability that a summary shows

Terms = str | Sequence[str]


@public
@dataclass(frozen=True, eq=False, repr=False)
class TermSelection:
    """The terms of an equation that records support, and the alternatives.

    Attributes
    ----------
    equation : Equation
        The chosen one, with a parameter for each term; several equations are one `Equation`.
    terms : dict of str to tuple of str
        Chosen terms of each left side.
    path : Table
        The best subset of each size: number of terms, terms, chi2 (cost in units of the noise), criterion,
        rise (over the lowest criterion), chosen, and with `test` records fit_percent, the mean over their
        outputs of how well a fit simulates them.
    inclusion : Table
        Each candidate: term, probability (the average over all subsets seen, weighted by exp(-criterion/2)),
        penalty, chosen, kept.
    alike : tuple of str
        Which terms the records do not tell apart, in words.
    band : (float, float)
        That all subsets were compared on, rad/s.
    noise_sd : dict of str to float
        Noise level of each output.
    notes : tuple of str
        What was done and what to look at, in sentences.
    records : tuple of Record
        The data.
    options : Options
        Of `fit`: the common band, and the noise.

    See Also
    --------
    modfun.select_terms : Makes it.
    modfun.plot.terms : Draws it.

    References
    ----------
    D. P. Foster, E. I. George, The risk inflation criterion for multiple regression, Ann. Stat. 22, 1994.

    Examples
    --------
    >>> import modfun as mf
    >>> duffing = mf.Equation("y'' + 0.3*y' + y + 0.5*y**3 = u")
    >>> rec = mf.simulate(duffing.model({}), input="2*sin(1.1*t) + 1.5*sin(2.3*t)", duration=20.0,
    ...                   intervals=1024, nsr=0.05)
    >>> found = mf.select_terms(rec, "y, y**2, y**3, y', y*y', u, u*y, 1", target="y''")
    >>> found.terms["y''"]
    ('y', 'y**3', "y'", 'u')
    """

    equation: Equation
    terms: Mapping[str, tuple[str, ...]]
    path: Table
    inclusion: Table
    alike: tuple[str, ...]
    band: tuple[float, float]
    noise_sd: Mapping[str, float]
    notes: tuple[str, ...]
    records: tuple[Record, ...]
    options: Options

    @cached_property
    def fit(self) -> Fit:
        """The chosen equation fitted by maximum likelihood on the common band.

        Its standard errors are conditional: they do not count that the terms were selected.
        """
        return _fit(self.records, self.equation, self.options)

    def summary(self) -> str:
        """Equation, inclusion probabilities, what is not told apart, and notes, as text."""
        likely = [
            f"{row['probability']:6.3f}  {'*' if row['chosen'] else ' '} {row['term']}"
            for row in self.inclusion
            if row["chosen"] or row["probability"] >= LIKELY
        ]
        parts = [
            "\n".join(self.equation.texts),
            "",
            "Probability that a term belongs (* chosen):",
            *likely,
            "",
            *self.alike,
            *self.notes,
        ]
        return "\n".join(parts)

    def plot(self, *, ax: Any = None) -> Any:
        """Criterion over the number of terms, and inclusion probabilities; see `modfun.plot.terms`."""
        return drawing_terms.terms(self.path, self.inclusion, ax)

    def __repr__(self) -> str:
        return "\n".join([*self.equation.texts, "", repr(self.path), "", *self.alike, *self.notes])

    def _repr_html_(self) -> str:
        return (
            html.listing(self.equation.texts)
            + self.path._repr_html_()
            + html.listing((*self.alike, *self.notes))
        )


@public
def select_terms(
    data: Record | Sequence[Record],
    library: Terms | Mapping[str, Terms],
    *,
    target: str | Sequence[str] | None = None,
    keep: Terms | Mapping[str, Terms] | None = None,
    test: Record | Sequence[Record] | None = None,
    noise: str | Noise = "output",
) -> TermSelection:
    """Find the terms of differential equations among candidates.

    All subsets are compared on the same lines, with as many transient terms as the highest derivative
    asks for. The noise of the outputs is followed through every candidate: what it adds to nonlinear terms
    on average is taken out, and the residuals are weighted by their covariance, which depends on the
    estimate. The whole library is fitted by maximum likelihood; the Gram matrix there gives the cost of any
    subset (beams forward and backward, then exchanges); the best subset is fitted by maximum likelihood,
    and so on until the best subset stays.

    The criterion is chi2, the weighted squares of the residuals in units of the noise, plus a penalty for
    each term: the quantile of chi-squared that a superfluous term exceeds with probability
    0.01/(2^(d+1) n), n the number of candidates of its degree d. All together come in with a probability of
    at most 1 %, and simple terms more easily than those of high degree. There is no threshold to tune.

    Parameters
    ----------
    data : Record or sequence of Record
        Every state that the terms name must be measured, with even samples. Several records are one
        problem: the same coefficients, end conditions of their own.
    library : str, sequence of str, or mapping of left sides to these
        Candidates: terms, ``"y, y**2, sin(y), y*y', u, u*y, 1"``, and families, ``"polynomials of y, u up to
        3"`` (all monomials, with 1), separated by commas. Each must be a function of channels and time,
        or a derivative of one. One library serves all equations unless a mapping gives each its own.
        Monomials of a family that are not the derivative of a signal, such as ``y'**2``, are left out.
    target : str or sequence of str, optional
        Left sides, ``"y''"``. Default: the first derivative of each output.
    keep : like `library`, optional
        Terms that are known to belong.
    test : Record or sequence of Record, optional
        Records that are simulated by fits of the subsets on the path.
    noise : "output" or Noise, default "output"
        White noise on the outputs, its levels read from the high band, or given: ``mf.Noise(y=[...])``.

    Returns
    -------
    TermSelection

    Raises
    ------
    SpecError
        A term outside the language or of no use, a name that is not a channel, an empty or too large library.
    DataError
        Uneven or masked samples, or a record too short for the library.
    FitError
        No estimate: numbers without a value.

    See Also
    --------
    modfun.TermSelection : What it returns.
    modfun.select_order : Orders of transfer functions.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, sections 3 and 4.10; D. P. Foster, E. I. George, The
    risk inflation criterion for multiple regression, Ann. Stat. 22, 1994.

    Examples
    --------
    >>> import modfun as mf
    >>> model = mf.Equation(["x' = x - 0.5*x*z", "z' = -0.8*z + 0.4*x*z"], outputs=["x", "z"])
    >>> rec = mf.simulate(model.model({}), duration=20.0, intervals=512, nsr=0.05, initial_state=[2, 1])
    >>> found = mf.select_terms(rec, "polynomials of x, z up to 2")
    >>> found.equation.texts
    ("x' = c1*x + c2*x*z", "z' = c3*z + c4*x*z")
    """
    records = records_of(data, "select_terms")
    tests = () if test is None else records_of(test, "select_terms")
    if not isinstance(noise, Noise) and noise != "output":
        raise SpecError(f'select_terms: noise={noise!r} must be "output" or mf.Noise(y=...)')
    for rec in records:
        refuse_own_noise(rec, "select_terms", "take a piece without them, rec.window(start, stop)")
        if rec.dt is None:
            raise DataError(
                "select_terms: a record is sampled unevenly; interpolate it onto even times, as "
                "numpy.interp does"
            )
    first = records[0]
    found = library_of(library, target, keep, first.outputs, first.inputs, first.intersample)
    levels = [_levels(rec, noise, found.columns.parts.shape[1] - 1) for rec in records]
    tops, edge = _band(records, levels, found)
    lines = [
        Lines(rec, found.columns, found.equation, sd**2, top, edge)
        for rec, sd, top in zip(records, levels, tops, strict=True)
    ]
    with np.errstate(all="ignore"):  # of candidates that overflow on the way
        searched = Search(lines, found.kept, found.degrees).run()
    if not np.isfinite(searched.estimate.cost):
        raise FitError(
            "select_terms: no subset of the library has a finite likelihood; scale the channels, or leave "
            "out terms that grow fast"
        )
    return _selection(records, tests, found, searched, levels, edge, noise)


# The problem ----------------------------------------------------------------------------------------


def _levels(rec: Record, noise: str | Noise, order: int) -> F64:
    """Noise level of each output, as given or as the high band shows it."""
    outputs = len(rec.outputs)
    if still := [name for name, row in zip(rec.outputs, rec.y, strict=True) if np.ptp(row) == 0]:
        raise DataError(
            f"select_terms: the output {still[0]!r} of a record never changes; leave it out, "
            "rec.select(outputs=[...])"
        )
    least = SILENT * np.max(np.abs(rec.y), axis=1)
    if isinstance(noise, Noise):
        if noise.y is None or noise.u is not None:
            raise SpecError("select_terms: noise=mf.Noise(y=...) gives levels of outputs; inputs are known")
        try:
            given = np.broadcast_to(np.asarray(noise.y, dtype=float), (outputs,))
        except (TypeError, ValueError):
            raise SpecError(
                f"select_terms: noise=mf.Noise(y=...) takes standard deviations, one or one per "
                f"output ({outputs})"
            ) from None
        return np.asarray(np.maximum(given, least))
    return np.asarray(np.maximum(rec.noise_level(order)["noise_sd"][:outputs], least))


def _band(records: Sequence[Record], levels: Sequence[F64], found: Library) -> tuple[list[int], float]:
    """Highest line of each record, and the common edge in rad/s.

    Up to where an output shows more than noise, but as many lines as tell the candidates apart.
    """
    order = found.columns.parts.shape[1] - 1
    most = int(np.max(np.bincount(found.equation))) + order
    wide, own = [], []
    for rec, sd in zip(records, levels, strict=True):
        omega0 = 2 * np.pi / rec.duration
        most_lines = max(rec.intervals // 8, min(rec.intervals // 4, 16))
        wide.append(most_lines * omega0)
        own.append(max(signal_edge(rec, sd**2, order, most_lines), most) * omega0)
    edge = min(max(own), *wide)
    tops = [int(edge * rec.duration / (2 * np.pi) + 1e-9) for rec in records]
    rows = sum((2 * top + 1) - order for top in tops)
    if rows <= most:
        raise DataError(
            f"select_terms: the records give {rows} real equations up to {edge:.4g} rad/s, and the library "
            f"has {most - order} terms in an equation; take longer or faster sampled records, or a smaller "
            "library"
        )
    return tops, edge


# The answer -----------------------------------------------------------------------------------------


def _selection(
    records: tuple[Record, ...],
    tests: tuple[Record, ...],
    library: Library,
    searched: Searched,
    levels: Sequence[F64],
    edge: float,
    noise: str | Noise,
) -> TermSelection:
    first = records[0]
    equation = _equation(library, searched.chosen, first)
    options = Options.checked("select_terms", band=(0.0, edge * (1 + 1e-9)), noise=noise)
    labels = library.labels()
    by_weight = weights(searched.subsets)
    masks = np.array([mask for mask, _ in searched.subsets])
    inclusion = Table(
        {
            "term": labels,
            "probability": by_weight @ masks,
            "penalty": searched.moments.penalty,
            "chosen": searched.chosen,
            "kept": np.array(library.kept),
        }
    )
    terms = {
        left: tuple(
            term
            for on, e, term in zip(searched.chosen, library.equation, library.terms, strict=True)
            if on and e == k
        )
        for k, left in enumerate(library.targets)
    }
    sd = np.sqrt(np.mean([own**2 for own in levels], axis=0))
    return TermSelection(
        equation=equation,
        terms=terms,
        path=_path(records, tests, library, searched, options),
        inclusion=inclusion,
        alike=_alike(labels, searched),
        band=(0.0, edge),
        noise_sd=dict(zip(first.outputs, map(float, sd), strict=True)),
        notes=_notes(library, searched),
        records=records,
        options=options,
    )


def _equation(library: Library, chosen: Any, rec: Record) -> Equation:
    """The equation of a subset, its parameters named as no channel is."""
    names = (*rec.outputs, *rec.inputs)
    letter = next(
        one
        for one in ("c", "k", "p", "theta", "coefficient")
        if not any(re.fullmatch(rf"{one}\d*", name) for name in names)
    )
    count = iter(range(1, len(library.terms) + 1))
    texts = library.texts(chosen, [f"{letter}{next(count)}" if on else "" for on in chosen])
    used = set(re.findall(r"[A-Za-z][A-Za-z0-9_]*", " ".join(texts)))
    return Equation(
        texts,
        outputs=[name for name in rec.outputs if name in used],
        inputs=[name for name in rec.inputs if name in used],
    )


def _fit(records: Sequence[Record], equation: Equation, options: Options) -> Fit:
    own = [
        rec
        if (rec.outputs, rec.inputs) == (equation.outputs, equation.inputs)
        else rec.select(outputs=list(equation.outputs), inputs=list(equation.inputs))
        for rec in records
    ]
    return fit_quietly(tuple(own), equation, options)


def _path(
    records: Sequence[Record],
    tests: Sequence[Record],
    library: Library,
    searched: Searched,
    options: Options,
) -> Table:
    """The best subset of each size up to a few more than the chosen one."""
    labels, size = library.labels(), int(searched.chosen.sum())
    best: dict[int, tuple[Any, float]] = {}
    for mask, value in searched.subsets:
        best.setdefault(int(mask.sum()), (mask, value))
    best[size] = (searched.chosen, searched.criterion)
    rows = [best[k] for k in sorted(best) if 0 < k <= size + LARGER]
    values = np.array([value for _, value in rows])
    sizes = np.array([int(mask.sum()) for mask, _ in rows])
    columns: dict[str, Any] = {
        "terms": sizes,
        "which": [", ".join(label for on, label in zip(mask, labels, strict=True) if on) for mask, _ in rows],
        "chi2": values - np.array([searched.moments.penalty[mask].sum() for mask, _ in rows]),
        "criterion": values,
        "rise": values - np.nanmin(values),
        "chosen": sizes == size,
    }
    if tests:
        near = np.abs(sizes - size) <= LARGER
        columns["fit_percent"] = [
            _simulated(records, tests, _equation(library, mask, records[0]), options) if own else np.nan
            for (mask, _), own in zip(rows, near, strict=True)
        ]
    return Table(columns)


def _simulated(
    records: Sequence[Record], tests: Sequence[Record], equation: Equation, options: Options
) -> float:
    """How well a fit simulates other records, in per cent; nan where it has no response."""
    try:
        fit = _fit(records, equation, options)
        own = [rec.select(outputs=list(equation.outputs), inputs=list(equation.inputs)) for rec in tests]
        return float(np.mean([row["fit_percent"] for rec in own for row in fit.score(rec)]))
    except ModfunError:
        return float("nan")


def _alike(labels: Sequence[str], searched: Searched) -> tuple[str, ...]:
    """Exchanges of one chosen term for another that hardly change the criterion."""
    value = searched.criterion
    found = []
    for mask, other in searched.subsets:
        gone, come = searched.chosen & ~mask, mask & ~searched.chosen
        if gone.sum() == come.sum() == 1 and other - value < ALIKE:
            old, new = labels[int(np.argmax(gone))], labels[int(np.argmax(come))]
            found.append(
                f"The data hardly tell {old} from {new}: with {new} in its place the criterion rises by "
                f"{max(other - value, 0.0):.1f} only."
            )
    return tuple(found)


def _notes(library: Library, searched: Searched) -> tuple[str, ...]:
    free = sum(not one for one in library.kept)
    notes = [
        f"Penalties are such that a superfluous term, of {free} candidates, comes in with a probability of "
        f"at most {100 * FALSE_ALARM:g} %."
    ]
    if searched.excess - 1 > FAR * sqrt(2 / searched.freedom):
        notes.append(
            f"The whole library leaves residuals {sqrt(searched.excess):.2f} times the noise seen in the "
            "high band: the noise is not white, or a term is missing from the library."
        )
    if library.left_out:
        notes.append(f"Left out, being no derivative of a signal: {', '.join(library.left_out)}.")
    if not searched.estimate.settled:
        notes.append("The likelihood of the chosen terms has not converged; check the fit.")
    return tuple(notes)
