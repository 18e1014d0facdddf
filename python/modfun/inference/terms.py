"""Which terms an equation has: a library of candidates, and those that the records support."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ..base.arguments import public
from ..base.arrays import F64
from ..base.progress import Progress
from ..equations.written import Written
from ..errors import DataError, FitError, ModfunWarning, SpecError
from ..fitting.fit import records_of
from ..fitting.gaps import apart, bridged, relative, variances
from ..models.noise import Noise
from ..records.record import Record
from ..results.diagnosis import level_df
from .common import widest
from .library import Library, library_of
from .moments import Lines, signal_edge
from .term_noise import Noted, may_be_odd, noted_of
from .term_records import unlike_terms
from .term_search import Search
from .term_selection import End, TermSelection, chosen_fit, selection, sparse

__all__ = ["select_terms"]

SILENT = 1e-9  # least noise level, over the size of a channel
SEARCHES = 8  # of subsets that a selection takes, mostly

Terms = str | Written | Sequence[str | Written]


@public
def select_terms(
    data: Record | Sequence[Record],
    library: Terms | Mapping[str, Terms],
    *,
    target: str | Sequence[str] | None = None,
    keep: Terms | Mapping[str, Terms] | None = None,
    signs: Mapping[str, str] | None = None,
    hierarchy: bool = False,
    test: Record | Sequence[Record] | None = None,
    noise: str | Noise = "output",
    progress: str | bool = "auto",
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
    0.01/(2^(d+1) n), n the number of candidates of its degree d. All together come in beside the true terms
    with a probability of at most 1 %, and simple terms more easily than those of high degree; `alike` names
    terms that may take the place of true ones. There is no threshold to tune.

    Parameters
    ----------
    data : Record or sequence of Record
        Every state that the terms name must be measured. Several records are one problem: the same
        coefficients, end conditions of their own. The noise level of uneven samples is that beside
        polynomials through their neighbours.
    library : str, Equation, StateSpace, sequence of these, or mapping of left sides to texts
        Candidates: terms, ``"y, y**2, sin(y), y*y', u, u*y, 1"``, and families, ``"polynomials of y, u up to
        3"`` (all monomials, with 1), separated by commas. Each must be a function of channels and time,
        or a derivative of one. One library serves all equations unless a mapping gives each its own.
        Monomials of a family that are not the derivative of a signal, such as ``y'**2``, are left out.
        Of a model, the terms with a parameter are candidates and those without form the left side; a list
        of a model and texts has further candidates.
    target : str or sequence of str, optional
        Left sides, ``"y''"``. Default: those of the model, or the first derivative of each output.
    keep : like `library`, optional
        Terms that are known to belong, also a model that is to be extended.
    signs : mapping of str to {"+", "-"}, optional
        Signs of coefficients on the right side: ``{"y**3": "-"}``, or ``{"x': x*z": "-"}`` for one of several
        equations. Parameters of a model with bounds at or beyond zero, ``mf.Free(min=0)``, have signs, too.
    hierarchy : bool, default False
        True: a product of different factors, ``"alpha*q"``, comes in only with those of its factors that are
        candidates.
    test : Record or sequence of Record, optional
        Records not used, which are simulated by fits of the subsets on the path.
    noise : "output" or Noise, default "output"
        White noise on the outputs, its levels read from the high band, or given: ``mf.Noise(y=[...])``.
        Up to three masked samples in a row are bridged; what lies around longer gaps are records of their
        own, if that is most of the record. `sigma` of a record weighs its samples, as in `fit`. Where the
        fit of the chosen terms shows that the level of even samples changes, as that of counts does, they
        are weighted by it, and the search is made again; `notes` say so.
    progress : {"auto", True, False}
        "auto": progress on standard error if the search takes longer than two seconds.

    Returns
    -------
    TermSelection

    Raises
    ------
    SpecError
        A term outside the language or of no use, a name that is not a channel, an empty or too large library.
    DataError
        Long gaps, an output that never changes, or a record too short for the library.
    FitError
        No estimate: numbers without a value, or terms of `keep` that contradict `signs`.

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
    if isinstance(noise, str) and noise == "log-normal":
        raise SpecError(
            'select_terms: noise="log-normal" is for fits; select terms with noise="output", which weights '
            "samples whose noise goes with their level, and fit the chosen equation, "
            'mf.fit(rec, found.equation, noise="log-normal")'
        )
    if not isinstance(noise, Noise) and noise != "output":
        raise SpecError(f'select_terms: noise={noise!r} must be "output" or mf.Noise(y=...)')
    found = library_of(library, target, keep, records, signs, hierarchy)
    steps = iter(range(1, 1000))
    with Progress(progress, "select_terms") as bar:

        def tick() -> None:
            step = next(steps)
            bar(step, max(SEARCHES, step + 1))

        chosen = _search(records, found, noise, tick)
        noted, fit = Noted(), None
        if may_be_odd(records):
            fit = chosen_fit(records, found, chosen, noise)
            noted = noted_of(records, fit)
            if noted.records:
                records, fit = noted.records, None
                chosen = _search(records, found, noise, tick)
    if text := sparse(records, chosen.edge, chosen.searched):
        warnings.warn(f"select_terms: {text}", ModfunWarning, stacklevel=3)
    made = selection(records, tests, found, chosen, noise, noted, fit)
    alone = partial(
        select_terms,
        library=library,
        target=target,
        keep=keep,
        signs=signs,
        hierarchy=hierarchy,
        noise=noise,
        progress=False,
    )
    told = unlike_terms(records, chosen.searched.excess, alone)
    return replace(made, notes=(*made.notes, told)) if told else made


# The problem ----------------------------------------------------------------------------------------


class Part(NamedTuple):
    """A record, or what lies around gaps of it of which nothing is known.

    `k`: which one of the records; `y`: outputs with masked samples bridged; `sd`: noise level of each output;
    `variance`: that of each sample.
    """

    k: int
    record: Record
    y: F64
    sd: F64
    variance: F64


def _search(records: tuple[Record, ...], found: Library, noise: str | Noise, tick: Callable[[], None]) -> End:
    """The best subset of a library on the common band of records."""
    order = found.order
    parts, levels = list[Part](), []
    for k, rec in enumerate(records):
        own = apart(rec)
        sd = _levels([piece for piece, _ in own], noise, order)
        y, off, more = bridged(rec)
        variance = _variances(rec, off, more, sd, order)
        parts += [Part(k, piece, np.ascontiguousarray(y[:, at]), sd, variance[:, at]) for piece, at in own]
        levels.append(sd)
    tops, edge = _band(parts, found)
    lines = [
        Lines(part.k, part.record, part.y, found.columns, found.equation, part.variance, top, edge)
        for part, top in zip(parts, tops, strict=True)
    ]
    high = len(records[0].outputs) * level_df([rec.intervals for rec in records], order)
    given = isinstance(noise, Noise)
    with np.errstate(all="ignore"):  # candidates may overflow
        searched = Search(lines, found.kept, found.degrees, found.signs, found.needs, high, given, tick).run()
    if not np.isfinite(searched.estimate.cost):
        raise FitError(
            "select_terms: no subset of the library has a finite likelihood; scale the channels, or leave "
            "out terms that grow fast"
        )
    return End(searched, levels, edge)


def _levels(pieces: Sequence[Record], noise: str | Noise, order: int) -> F64:
    """Noise level of each output of a record, as given or as the high band of its pieces shows it."""
    rec = pieces[0]
    y = np.concatenate([piece.y for piece in pieces], axis=1)
    if still := [name for name, row in zip(rec.outputs, y, strict=True) if np.ptp(row) == 0]:
        raise DataError(
            f"select_terms: the output {still[0]!r} of a record never changes; leave it out, "
            "rec.select(outputs=[...])"
        )
    least = SILENT * np.max(np.abs(y), axis=1)
    if isinstance(noise, Noise):
        if noise.y is None or noise.u is not None:
            raise SpecError("select_terms: noise=mf.Noise(y=...) gives levels of outputs; inputs are known")
        try:
            given = np.broadcast_to(np.asarray(noise.y, dtype=float), (len(y),))
        except (TypeError, ValueError):
            raise SpecError(
                f"select_terms: noise=mf.Noise(y=...) takes standard deviations, one or one per "
                f"output ({len(y)})"
            ) from None
        return np.asarray(np.maximum(given, least))
    own = [piece.noise_level(order)["noise_sd"][: len(y)] ** 2 for piece in pieces]
    mean = np.average(own, axis=0, weights=[piece.intervals for piece in pieces])
    return np.asarray(np.maximum(np.sqrt(mean), least))


def _variances(rec: Record, off: F64, noise: F64, sd: F64, order: int) -> F64:
    """Variance of each sample of the outputs: their mean level, where samples count differently."""
    own = variances(rec, off, noise, order)
    if own is None:
        return np.asarray(np.broadcast_to(sd[:, None] ** 2, rec.y.shape))
    own = relative(own)
    good = np.ones_like(own, dtype=bool) if rec.mask is None else rec.mask
    return np.asarray(own * (sd**2 / np.mean(own, axis=1, where=good))[:, None])


def _band(parts: Sequence[Part], found: Library) -> tuple[list[int], float]:
    """Highest line of each part, and the common edge in rad/s.

    Up to where an output shows more than noise, but as many lines as tell the candidates apart.
    """
    order = found.order
    most = int(np.max(np.bincount(found.equation))) + order
    wide, own = [], []
    for k, rec, y, sd, _ in parts:
        omega0 = 2 * np.pi / rec.duration
        times = rec.t - rec.t[0] if rec.dt is None else None
        # Sums see nothing within the longest of uneven steps; few lines are still better than none.
        steps = rec.intervals if times is None else int(rec.duration / np.max(np.diff(times)))
        least = 0.0 if times is None else min(most, rec.intervals // 4) * omega0
        wide.append(max(widest([steps], [omega0]), least))
        lines = round(wide[-1] / omega0)
        if rec.duration < max(part.record.duration for part in parts if part.k == k):
            continue  # the least edge that so few lines allow is far above that of the longest part
        own.append(max(signal_edge(y, sd**2, order, lines, times), most) * omega0)
    edge = min(max(own), *wide)
    tops = [int(edge * part.record.duration / (2 * np.pi) + 1e-9) for part in parts]
    rows = sum((2 * top + 1) - order for top in tops)
    if rows <= most:
        raise DataError(
            f"select_terms: the records give {rows} real equations up to {edge:.4g} rad/s, and the library "
            f"has {most - order} terms in an equation; take longer or faster sampled records, or a smaller "
            "library"
        )
    return tops, edge
