"""What a search for terms found: the chosen equation, the path, probabilities, and what to look at."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from ..base import html
from ..base.arguments import public
from ..base.arrays import F64
from ..base.cached import cached_property
from ..base.elsewhere import TERMS, Elsewhere
from ..base.tables import Table
from ..equations.equation import Equation
from ..errors import ModfunError
from ..fitting.single import fit_quietly
from ..models.noise import Noise
from ..models.options import Options
from ..records.record import Record
from ..results.fit import Fit
from . import drawing_terms
from .library import Library
from .term_noise import Noted
from .term_rivals import alike, weights
from .term_search import FALSE_ALARM, Searched

__all__ = ["End", "TermSelection", "chosen_fit", "fit_terms", "selection", "sparse"]

LARGER = 3  # sizes beyond the chosen one that the path shows
LIKELY = 0.01  # least probability that a summary shows
AVERAGED = 1e-6  # least weight of a subset in the averages
# A step that is so much of the band's shortest period, and residuals so many times the noise, say that sums
# over uneven samples err. With steps of a quarter of it they hardly do.
SPARSE, GUESSED, FINE = 0.3, 3.0, 4
CERTAIN, SMALL = 0.999, 1.5  # probability of a term, and |t| in a fit, that contradict each other


class End(NamedTuple):
    """Where a search ended, the noise levels of each record, and the edge of the common band, rad/s."""

    searched: Searched
    levels: Sequence[F64]
    edge: float


@public
@dataclass(frozen=True, eq=False, repr=False)
class TermSelection(Elsewhere):
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
        Each candidate: term, probability, value and se of its coefficient (averages over all subsets seen,
        weighted by exp(-criterion/2), or as BIC has it where two terms are in place of a chosen one; zero
        where a subset lacks the term: this se counts the selection),
        penalty, chosen, kept.
    alike : tuple of str
        Which terms the records do not tell apart, in words: one in place of another one, two in place of
        one, or one in place of two.
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

    _elsewhere = TERMS

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

        Its standard errors are conditional: they do not count that the terms were selected. Those of
        `inclusion` do.
        """
        return fit_terms(self.records, self.equation, self.options)

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
            *([f" {rest} more below {LIKELY:g}"] if (rest := len(self.inclusion) - len(likely)) else ()),
            "",
            *self.alike,
            *self.notes,
        ]
        return "\n".join(parts)

    def to_latex(self) -> str:
        """The chosen equations with their estimates, as LaTeX.

        Numbers have two significant digits of their standard error.

        Returns
        -------
        str
        """
        from ..equations.symbolic.latex import aligned, latex_of, rounded

        names = (*self.equation.outputs, *self.equation.inputs)
        at, rows = map(rounded, self.fit.params, self.fit.bse), []
        for left, terms in self.terms.items():
            side = " + ".join(
                next(at) + ("" if term == "1" else rf"\,{latex_of(term, names)}") for term in terms
            )
            rows.append(f"{latex_of(left, names)} &= {side.replace('+ -', '- ') or '0'}")
        return aligned(rows)

    def to_markdown(self) -> str:
        """The chosen equations as a block of mathematics, and the table of their fit, as Markdown.

        Returns
        -------
        str
        """
        equations = ", ".join(f"`{text}`" for text in self.equation.texts)
        return f"$$\n{self.to_latex()}\n$$\n\n{equations}\n\n{self.fit.table().to_markdown()}"

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


def selection(
    records: tuple[Record, ...],
    tests: tuple[Record, ...],
    library: Library,
    end: End,
    noise: str | Noise,
    noted: Noted,
    fit: Fit | None,
) -> TermSelection:
    """The answer, made of the end of a search; `fit`: that of the chosen equation, if it was made."""
    first = records[0]
    searched, levels, edge = end
    equation = _equation(library, searched.chosen, first)
    options = _options(edge, noise)
    if fit is None and searched.coloured:
        fit = chosen_fit(records, library, end, noise)
    labels = library.labels()
    by_weight = weights(searched)
    masks = np.array([mask for mask, _ in searched.subsets])
    value, se = _averages(searched, by_weight)
    inclusion = Table(
        {
            "term": labels,
            "probability": by_weight @ masks,
            "value": value,
            "se": se,
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
    found = TermSelection(
        equation=equation,
        terms=terms,
        path=_path(records, tests, library, searched, options),
        inclusion=inclusion,
        alike=alike(labels, searched),
        band=(0.0, edge),
        noise_sd=dict(zip(first.outputs, map(float, sd), strict=True)),
        notes=_notes(library, searched, noise, sparse(records, edge, searched), noted)
        + _unlike(inclusion, fit if searched.coloured else None),
        records=records,
        options=options,
    )
    if fit is not None:
        found.__dict__["fit"] = fit
    return found


def chosen_fit(records: tuple[Record, ...], library: Library, end: End, noise: str | Noise) -> Fit | None:
    """The fit of the chosen equation; None where it has none."""
    try:
        return fit_terms(
            records, _equation(library, end.searched.chosen, records[0]), _options(end.edge, noise)
        )
    except ModfunError:
        return None


def _options(edge: float, noise: str | Noise) -> Options:
    return Options.checked("select_terms", band=(0.0, edge * (1 + 1e-9)), noise=noise)


def _averages(searched: Searched, by_weight: F64) -> tuple[F64, F64]:
    """Coefficients averaged over subsets, and their standard errors within and between these."""
    near = [k for k, weight in enumerate(by_weight) if weight > AVERAGED]
    share = by_weight[near] / by_weight[near].sum()
    masks = [searched.subsets[k][0] for k in near]
    theta = np.array([searched.moments.estimate(mask) for mask in masks])
    own = np.array([np.diag(searched.moments.covariance(mask)) for mask in masks])
    mean = share @ theta
    return mean, np.sqrt(share @ (own + (theta - mean) ** 2))


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


def fit_terms(records: Sequence[Record], equation: Equation, options: Options) -> Fit:
    """The fit of an equation of chosen terms to the channels that it has."""
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
        columns["fit_percent"] = [
            _simulated(records, tests, _equation(library, mask, records[0]), options) for mask, _ in rows
        ]
    return Table(columns)


def _simulated(
    records: Sequence[Record], tests: Sequence[Record], equation: Equation, options: Options
) -> float:
    """How well a fit simulates other records, in per cent; nan where it has no response."""
    try:
        fit = fit_terms(records, equation, options)
        own = [rec.select(outputs=list(equation.outputs), inputs=list(equation.inputs)) for rec in tests]
        return float(np.mean([row["fit_percent"] for rec in own for row in fit.score(rec)]))
    except ModfunError:
        return float("nan")


def sparse(records: Sequence[Record], edge: float, searched: Searched) -> str:
    """That sums over uneven samples err by more than the noise, in words with a full stop; else "".

    Runs between samples that are as far apart as a part of the band's shortest period are guessed.
    """
    steps = [float(np.max(np.diff(rec.t))) for rec in records if rec.dt is None]
    period, longest = 2 * pi / edge, max(steps, default=0.0)
    excess = sqrt(searched.excess)
    if not (searched.coloured and longest > SPARSE * period and excess > GUESSED):
        return ""
    return (
        f"The longest step between samples is {longest:.3g} s and the shortest period of the band is "
        f"{period:.3g} s: sums over the samples err there, the whole library leaves residuals "
        f"{excess:.3g} times the noise, and terms may be missing or wrong. Sample with steps of at most "
        f"{period / FINE:.2g} s, or take a part of the record without longer ones."
    )


def _unlike(inclusion: Table, fit: Fit | None) -> tuple[str, ...]:
    """Terms that are certain with lines weighted by residuals, and of no size by the fit's one level."""
    if fit is None or not fit.usable:
        return ()
    chosen = [row for row in inclusion if row["chosen"]]
    t = [abs(value / se) if se > 0 else SMALL for value, se in zip(fit.params, fit.bse, strict=True)]
    small = [
        f"{row['term']} ({size:.2g})"
        for row, size in zip(chosen, t, strict=True)
        if row["probability"] > CERTAIN and size < SMALL
    ]
    if not small:
        return ()
    return (
        f"By found.fit, whose level of noise is one for all lines, these terms may be zero (|t|): "
        f"{', '.join(small)}. Their probability near 1 rests on lines that leave far less than that level; "
        "leave them out unless another record has them as well.",
    )


def _notes(
    library: Library, searched: Searched, noise: str | Noise, sampling: str, noted: Noted
) -> tuple[str, ...]:
    free = sum(not one for one in library.kept)
    notes = [
        f"Penalties are such that a superfluous term, of {free} candidates, comes in beside the true ones "
        f"with a probability of at most {100 * FALSE_ALARM:g} %; terms in place of true ones do not count."
    ]
    if noted.computed is not None:
        v, x = noted.computed.derivative, noted.computed.source
        notes = [
            f"{noted.computed.in_words()} The criterion counts on noise of its own in {v}, and differences "
            "err by more than noise: terms may be superfluous, with a probability near 1. Leave "
            f"{v} out, and select the terms of {x} alone: target=\"{x}''\", with {x}' in place of {v} in the "
            "library."
        ]
    if noted.uneven:
        notes.append(noted.uneven)
    if sampling:
        notes.append(sampling)
    elif searched.coloured:
        signed = ", or a sign is wrong" if any(library.signs) else ""
        origin = "given" if isinstance(noise, Noise) else "seen in the high band"
        why = (
            f"{noted.computed.derivative} is computed"
            if noted.computed is not None
            else f"the noise is not white, or a term is missing from the library{signed}"
            if searched.excess > 1
            else "the high band has signal, too, as with few samples per period; sample faster where you can"
        )
        notes.append(
            f"The whole library leaves residuals {sqrt(searched.excess):.3g} times the noise {origin}: "
            f"{why}. The lines were weighted by the residuals around them."
        )
    bare = [
        left
        for k, left in enumerate(library.targets)
        if not any(on and e == k for on, e in zip(searched.chosen, library.equation, strict=True))
    ]
    if bare:
        beyond = "what these sums err by" if sampling else "the noise"
        notes.append(f"No candidate explains {' or '.join(bare)} beyond {beyond}: nothing is chosen for it.")
    if library.left_out:
        notes.append(f"Left out, being no derivative of a signal: {', '.join(library.left_out)}.")
    if not searched.estimate.settled:
        notes.append("The likelihood of the chosen terms has not converged; check the fit.")
    return tuple(notes)
