"""Sets of terms, neither within the chosen one nor around it, that explain the records about as well."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import F64
from .term_search import Searched

__all__ = ["alike", "weights"]

ALIKE = 6.0  # rise at an exchange, under which the terms are not told apart
FAR = 14.0  # the same where a weight in averages is next to none
MOST = 3  # exchanges of different size that are told
EXCHANGES = {(1, 1), (1, 2), (2, 1)}  # how many terms go and come


class Rival(NamedTuple):
    """A set of terms that an exchange makes of the chosen one.

    `gone`, `come`: places of the terms; `chi2`, `criterion`: what these rise by; `rise`: by what the rival is
    judged.
    """

    gone: tuple[int, ...]
    come: tuple[int, ...]
    chi2: float
    criterion: float
    rise: float


def alike(labels: Sequence[str], searched: Searched) -> tuple[str, ...]:
    """Exchanges that the records hardly tell from the chosen terms, in words, the closest first.

    What only adds to an exchange that is told already is left out.
    """
    told, uneven = list[Rival](), 0
    for rival in sorted(_rivals(searched), key=lambda one: (len(one.gone) + len(one.come), one.rise)):
        known = any(set(one.gone) <= set(rival.gone) and set(one.come) <= set(rival.come) for one in told)
        differs = len(rival.gone) != len(rival.come)
        if rival.rise < ALIKE and not known and not (differs and uneven == MOST):
            told.append(rival)
            uneven += differs
    return tuple(_in_words(labels, one) for one in told)


def weights(searched: Searched) -> F64:
    """Weights of the subsets in an average, of sum 1: exp(−½ criterion), of rivals exp(−½ rise)."""
    values = np.array([value for _, value in searched.subsets])
    places = {mask.tobytes(): k for k, (mask, _) in enumerate(searched.subsets)}
    for rival in _rivals(searched):
        mask = searched.chosen.copy()
        mask[[*rival.gone]], mask[[*rival.come]] = False, True
        values[places[mask.tobytes()]] = searched.criterion + rival.rise
    found = np.exp(-0.5 * (values - values.min()))
    return np.asarray(found / found.sum())


def _rivals(searched: Searched) -> Iterator[Rival]:
    """What exchanges make of the chosen terms.

    Penalties guard against the luckiest of many superfluous terms, which lowers chi2 whatever the truth is.
    Of two sets that do not contain each other, the wrong one mostly has the higher chi2: there a term more
    counts as in BIC, or a pair that explains the records better than its rival would seem impossible.
    """
    more = log(searched.freedom + int(np.sum(searched.moments.independent)))
    penalty, chosen = searched.moments.penalty, np.asarray(searched.chosen)
    for mask, value in searched.subsets:
        gone, come = np.flatnonzero(chosen & ~mask), np.flatnonzero(mask & ~chosen)
        if (gone.size, come.size) in EXCHANGES:
            rise = criterion = float(value - searched.criterion)
            chi2 = float(criterion - penalty[come].sum() + penalty[gone].sum())
            if come.size > gone.size and chi2 + more < min(criterion, FAR) and _needed(searched, mask, come):
                rise = max(chi2 + more, 0.0)  # no likelier than what was chosen
            yield Rival(tuple(gone.tolist()), tuple(come.tolist()), chi2, criterion, rise)


def _needed(searched: Searched, mask: Any, come: Any) -> bool:
    """Whether each of the terms that come would have its place in the subset by its penalty."""
    size = searched.moments.estimate(mask)[come] ** 2
    bar = searched.moments.penalty[come] * np.diag(searched.moments.covariance(mask))[come]
    return bool(np.all(size > bar))


def _in_words(labels: Sequence[str], rival: Rival) -> str:
    old, new = (" and ".join(labels[k] for k in which) for which in (rival.gone, rival.come))
    its = "its" if len(rival.gone) == 1 else "their"
    text = f"The data hardly tell {old} from {new}: with {new} in {its} place "
    if len(rival.gone) == len(rival.come):
        return f"{text}the criterion rises by {max(rival.criterion, 0.0):.1f} only."
    way = "falls" if rival.chi2 < 0 else "rises"
    size = "one term more" if len(rival.come) > len(rival.gone) else "one term less"
    return (
        f"{text}chi2 {way} by {abs(rival.chi2):.1f}, with {size}, and the criterion rises by "
        f"{max(rival.criterion, 0.0):.1f}. A record from other initial states or with another input may tell."
    )
