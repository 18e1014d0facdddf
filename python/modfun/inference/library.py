"""Libraries of candidate terms: texts and families of polynomials, for one equation or several."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from ..base.names import nearest
from ..equations.symbolic.candidates import Side, sides_of
from ..equations.symbolic.columns import Columns, columns_of, read_term
from ..equations.written import Written
from ..errors import SpecError
from ..language.parser import expression, separated
from ..records.forms import forms_of
from ..records.record import Record

__all__ = ["Library", "library_of"]

MOST = 400  # candidates of all equations together
HIGHEST = 10  # degree of polynomials
_FAMILY = re.compile(r"polynomials\s+of\s+(?P<names>.+?)\s+up\s+to\s+(?P<degree>\d+)\s*(?=,|$)")
_MEANT = re.compile(r"\s*poly\w*\s+((?P<named>of|in)|(up\s+)?to)\b", re.IGNORECASE)
_FACTOR = re.compile(r"[A-Za-z][A-Za-z0-9_]*'*")
WHAT = "select_terms"


@dataclass(frozen=True)
class Library:
    """Candidates of every equation, on columns for the core.

    Attributes
    ----------
    targets : tuple of str
        What each equation explains: its left side.
    terms : tuple of str
        Candidates of the first equation, then of the second, ….
    equation : tuple of int
        The equation of each candidate.
    kept : tuple of bool
        Whether each candidate stays whatever the data say.
    signs : tuple of int
        1 or -1 where the sign of a coefficient is given, otherwise 0.
    needs : ndarray of bool, shape (candidate, candidate)
        Row k marks the candidates that must be in if k is.
    columns : Columns
        Of the targets, followed by the candidates.
    left_out : tuple of str
        Polynomials that are not the derivative of a signal.
    """

    targets: tuple[str, ...]
    terms: tuple[str, ...]
    equation: tuple[int, ...]
    kept: tuple[bool, ...]
    signs: tuple[int, ...]
    needs: Any
    columns: Columns
    left_out: tuple[str, ...]

    @property
    def degrees(self) -> tuple[int, ...]:
        """Of the candidates."""
        return self.columns.degrees[len(self.targets) :]

    @property
    def order(self) -> int:
        """Highest derivative of a signal."""
        return int(self.columns.parts.shape[1]) - 1

    def texts(self, chosen: Any, names: Sequence[str]) -> list[str]:
        """The equations with the chosen candidates, each with its coefficient."""
        sides: list[list[str]] = [[] for _ in self.targets]
        for on, e, term, name in zip(chosen, self.equation, self.terms, names, strict=True):
            if on:
                factor = term if _is_product(term) else f"({term})"
                sides[e].append(name if term == "1" else f"{name}*{factor}")
        return [f"{left} = {' + '.join(side) or '0'}" for left, side in zip(self.targets, sides, strict=True)]

    def labels(self) -> list[str]:
        """Each candidate with its equation, where there are several."""
        if len(self.targets) == 1:
            return list(self.terms)
        return [f"{self.targets[e]}: {term}" for e, term in zip(self.equation, self.terms, strict=True)]


def library_of(
    library: Any,
    target: Any,
    keep: Any,
    records: Sequence[Record],
    signs: Any = None,
    hierarchy: bool = False,
) -> Library:
    """The candidates that a user lists, for the channels of a record.

    Raises
    ------
    SpecError
        Text outside the language, no candidate, too many, a target among its own candidates, or signs of
        what is no candidate.
    """
    rec = records[0]
    outputs, inputs = rec.outputs, rec.inputs
    library, sides = _model_apart(library, "library")
    keep, more = _model_apart(keep, "keep")
    if (sides or more) and target is not None:
        raise SpecError(
            f"{WHAT}: target= is for libraries of text; the left sides of a model are its terms without a "
            "parameter"
        )
    if sides and more and [one.left for one in sides] != [one.left for one in more]:
        raise SpecError(f"{WHAT}: the models of library= and keep= have different left sides; give one model")
    of_models = [one.left for one in sides or more]
    targets = tuple(of_models) if of_models else _targets(target, outputs)
    terms: list[str] = []
    equation: list[int] = []
    kept: list[bool] = []
    signed: list[int] = []
    factors: list[tuple[str, ...]] = []
    forms: list[str] = []
    left_out: dict[str, None] = {}
    for e, left in enumerate(targets):
        given, doubtful = _terms(_own(library, left, targets, "library"), "library")
        always = _terms(_own(keep, left, targets, "keep"), "keep")[0] if keep is not None else []
        bounds = {
            text: sign
            for one in (sides, more)
            if one
            for text, sign in zip(one[e].terms, one[e].signs, strict=True)
        }
        always = [*(more[e].terms if more else ()), *always]
        given = [*(sides[e].terms if sides else ()), *given]
        read = {text: read_term(text, outputs, inputs, WHAT) for text in (left, *always, *given)}
        sound = [text for text in given if text not in doubtful or not read[text].fault]
        left_out.update(dict.fromkeys(text for text in given if text not in sound))
        seen: set[str] = set()
        for k, text in enumerate([*always, *sound]):
            own = read[text].form
            if own == read[left].form:
                raise SpecError(
                    f"{WHAT}: the term {text!r} is the left side of its own equation; leave it out"
                )
            if own not in seen:
                seen.add(own)
                terms.append(text)
                equation.append(e)
                kept.append(k < len(always))
                signed.append(bounds.get(text, 0))
                forms.append(own)
                factors.append(read[text].factors)
        if not seen:
            raise SpecError(
                f'{WHAT}: the library has no term for {left!r}; list some, as "y, y**2, u", or a family, '
                'as "polynomials of y, u up to 3"'
            )
    if len(terms) > MOST:
        raise SpecError(
            f"{WHAT}: the library has {len(terms)} terms in all, "
            f"at most {MOST} are searched; lower the degree"
        )
    needs = np.zeros((len(terms), len(terms)), dtype=bool)
    if hierarchy:
        for k, e in enumerate(equation):
            needs[k] = [f == e and form in factors[k] for f, form in zip(equation, forms, strict=True)]
    columns = columns_of((*targets, *terms), outputs, inputs, forms_of(records), WHAT)
    found = Library(
        targets, tuple(terms), tuple(equation), tuple(kept), tuple(signed), needs, columns, tuple(left_out)
    )
    return replace(found, signs=_signs(signs, found, forms, rec)) if signs is not None else found


def _model_apart(given: Any, name: str) -> tuple[Any, list[Side]]:
    """An argument without the model in it, and the sides of that model."""
    parts = [given] if isinstance(given, Written) else given
    if isinstance(parts, str | Mapping) or not isinstance(parts, Sequence):
        return given, []
    models = [one for one in parts if isinstance(one, Written)]
    if not models:
        return given, []
    if len(models) > 1:
        raise SpecError(f"{WHAT}: {name}= has {len(models)} models; give one, and further terms as text")
    return [one for one in parts if one is not models[0]], sides_of(models[0].compiled(), WHAT)


def _signs(given: Any, library: Library, forms: Sequence[str], rec: Record) -> tuple[int, ...]:
    """Signs by term, or by label where several equations have the term."""
    if not isinstance(given, Mapping) or any(value not in ("+", "-") for value in given.values()):
        raise SpecError(f'{WHAT}: signs={given!r} must map terms to "+" or "-", as {{"y**3": "-"}}')
    found, labels = list(library.signs), library.labels()
    for key, value in given.items():
        at = [k for k, label in enumerate(labels) if key == label]
        if not at and isinstance(key, str) and ":" not in key:
            own = read_term(key, rec.outputs, rec.inputs, WHAT).form
            at = [k for k, form in enumerate(forms) if form == own]
        if not at:
            raise SpecError(f"{WHAT}: signs= names {key!r}; {nearest(str(key), labels)}")
        for k in at:
            found[k] = 1 if value == "+" else -1
    return tuple(found)


def _targets(target: Any, outputs: tuple[str, ...]) -> tuple[str, ...]:
    if target is None:
        return tuple(f"{name}'" for name in outputs)
    found = (target,) if isinstance(target, str) else tuple(target)
    if not found or not all(isinstance(one, str) and one.strip() for one in found):
        raise SpecError(
            f"{WHAT}: target={target!r} must be the left side of an equation as text, \"y''\", or a "
            "list of these"
        )
    if len(set(found)) < len(found):
        raise SpecError(f"{WHAT}: target={target!r} names one left side twice; give each once")
    return found


def _own(given: Any, left: str, targets: tuple[str, ...], name: str) -> Any:
    """What an argument lists for one equation."""
    if not isinstance(given, Mapping):
        return given
    if strangers := [key for key in given if key not in targets]:
        keys = ", ".join(f'"{key}"' for key in given)
        raise SpecError(
            f"{WHAT}: {name}= has terms for {strangers[0]!r}, which is not a left side; these are "
            f"{', '.join(targets)}. Give other left sides beside the mapping: target=[{keys}]"
        )
    if left not in given and name == "library":
        raise SpecError(f"{WHAT}: library= has no terms for {left!r}; add them")
    return given.get(left, ())


def _terms(given: Any, name: str) -> tuple[list[str], set[str]]:
    """Texts of single terms, and which of them come from a family of polynomials."""
    if not isinstance(given, str | Sequence) or not all(isinstance(one, str) for one in given):
        raise SpecError(
            f'{WHAT}: {name}={given!r} must list terms as text, "y, y**2, u", or as a list of texts, or map '
            "left sides to these"
        )
    found: list[str] = []
    family: set[str] = set()
    for text in [given] if isinstance(given, str) else given:
        if (meant := _MEANT.match(text)) and not _FAMILY.search(text):
            lacks = "" if meant["named"] else ", which does not say of which signals"
            raise SpecError(f'{WHAT}: write a family as "polynomials of y, u up to 3", not {text!r}{lacks}')
        place = 0
        for match in _FAMILY.finditer(text):
            found += separated(text[place : match.start()], "library")
            own = _polynomials(match["names"], int(match["degree"]))
            found += own
            family.update(own)
            place = match.end()
        found += separated(text[place:], "library")
    return found, family


def _polynomials(names: str, degree: int) -> list[str]:
    """Monomials of names up to a degree, the constant included."""
    factors = [one.strip() for one in re.split(r",|\band\b", names) if one.strip()]
    if wrong := [one for one in factors if not _FACTOR.fullmatch(one)]:
        raise SpecError(
            f'{WHAT}: polynomials are of channels and their derivatives, as "polynomials of y, y\' up to 3", '
            f"not of {wrong[0]!r}"
        )
    if degree > HIGHEST:
        raise SpecError(f"{WHAT}: polynomials up to {degree} are too many; at most {HIGHEST}")
    found = ["1"]
    for total in range(1, degree + 1):
        for factor in combinations_with_replacement(dict.fromkeys(factors), total):
            powers = {name: factor.count(name) for name in factor}
            found.append("*".join(name if n == 1 else f"{name}**{n}" for name, n in powers.items()))
        if len(found) > MOST:
            raise SpecError(
                f"{WHAT}: polynomials of {', '.join(factors)} up to {degree} are more than {MOST} "
                "terms; lower the degree"
            )
    return found


def _is_product(term: str) -> bool:
    """Whether a coefficient may stand before a term without parentheses."""
    tree = expression(term, "term").tree
    factors = tree.parts if tree.kind == "product" else (tree,)
    return all(one.kind in ("name", "number", "call", "power", "prime") for one in factors)
