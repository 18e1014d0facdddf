"""What models written as equations have in common: terms, words, identifiability, equality."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from keyword import iskeyword
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import html
from ..base.names import nearest
from ..base.optional import optional
from ..base.samples import numbered
from ..base.tables import Table
from ..errors import SpecError
from ..language.parser import CONSTANTS, FUNCTIONS
from ..models.free import Free, bounds_meant
from ..records.record import Record

if TYPE_CHECKING:
    from .symbolic.compiled import Compiled

__all__ = [
    "TAKEN",
    "Explanation",
    "Identifiability",
    "Written",
    "channel_names",
    "outputs_left",
    "parameters_given",
]


TAKEN = frozenset(("t", *CONSTANTS, *FUNCTIONS)) - {"e"}  # as efficiencies and errors are called


class Explanation:
    """Sentences about a model; prints as text, shows as HTML in a notebook.

    Attributes
    ----------
    title : tuple of str
        The equations.
    sentences : tuple of str
    """

    __slots__ = ("sentences", "title")

    def __init__(self, title: Iterable[str], sentences: Iterable[str]) -> None:
        self.title, self.sentences = tuple(title), tuple(sentences)

    def __str__(self) -> str:
        return "\n".join([*(f"    {one}" for one in self.title), *(f"* {one}" for one in self.sentences)])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return html.listing(self.sentences, title="; ".join(self.title))


@dataclass(frozen=True)
class Identifiability:
    """Which parameters can be found from rich, noise-free records; True if all can.

    Local: parameters near the true ones are told apart, others far away need not be. Prints as sentences.

    Attributes
    ----------
    found : tuple of str
        Parameters with one value near the true one.
    lost : tuple of str
        Parameters that cannot be found one by one.
    rank : int
        Number of independent combinations of parameters that can be found.
    sentences : tuple of str
        What is lost, why, and what would help.
    """

    found: tuple[str, ...]
    lost: tuple[str, ...]
    rank: int
    sentences: tuple[str, ...]

    def __bool__(self) -> bool:
        return not self.lost

    @property
    def title(self) -> str:
        """How many parameters can be found, in words."""
        count = len(self.found) + len(self.lost)
        if not self.lost:
            return f"All {count} parameters can be found."
        return f"{self.rank} of {count} parameters, or combinations of them, can be found."

    def __str__(self) -> str:
        return "\n".join([self.title, *(f"* {text}" for text in self.sentences)])

    def _repr_html_(self) -> str:
        return html.listing(self.sentences, title=self.title)


class Written:
    """A model that is compiled to terms g(θ)·F·p^k E; equal and hashed by what it was made of."""

    __slots__ = ("__dict__",)

    # What a fit takes it for: no constant that is not written; not linear, so that there are no poles.
    trend: str | None = None
    linear = False

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    all_parameters: tuple[str, ...]
    params: tuple[tuple[str, float | Free], ...]

    def compiled(self, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None) -> Compiled:
        """Terms for the channels of a record.

        Parameters
        ----------
        outputs, inputs : sequence of str, optional
            Names of the record's channels; default: the model's own. Inputs that the model does not use are
            ignored.

        Returns
        -------
        Compiled

        Raises
        ------
        SpecError
            An equation outside the class, signals that the record has not, outputs that the model has not.
        ImportError
            Without SymPy (extra ``symbolic``).
        """
        optional("sympy", "symbolic", self._kind)
        return self._for_channels(self._compiled(), outputs, inputs)

    def simulated(
        self, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None
    ) -> Compiled:
        """The same for simulation alone, where signals that are not measured need not be eliminated.

        Parameters
        ----------
        outputs, inputs : sequence of str, optional
            As in `compiled`.

        Returns
        -------
        Compiled
            Without terms where a signal that is not measured cannot be eliminated.
        """
        optional("sympy", "symbolic", self._kind)
        return self._for_channels(self._simulated(), outputs, inputs)

    def _for_channels(
        self, compiled: Compiled, outputs: Sequence[str] | None, inputs: Sequence[str] | None
    ) -> Compiled:
        have = self.outputs if outputs is None else tuple(outputs)
        known = self.inputs if inputs is None else tuple(inputs)
        self._match(have, known)
        return replace(compiled, outputs=have, inputs=known)

    def param_names(
        self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> tuple[str, ...]:
        """Names of the parameters, in the order of their first appearance; what is held is none.

        Parameters
        ----------
        inputs, outputs : sequence of str, optional
            Names of a record's channels, which change nothing here.
        """
        return self.compiled(outputs, inputs).parameters

    def terms(self) -> Table:
        """The terms coefficient · operator [signal] that are fitted, p = d/dt; the sum of an equation is 0.

        Returns
        -------
        Table
            Columns equation, coefficient, operator and signal; `times` where there are products (Property 2).
        """
        compiled = self.compiled()
        from .symbolic.words import operator, said

        terms = compiled.terms
        columns: dict[str, list[Any]] = {
            "equation": [t.equation + 1 for t in terms],
            "coefficient": [said(t.coefficient) for t in terms],
            "operator": [operator(t.order) for t in terms],
            "signal": [said(t.signal) for t in terms],
        }
        if any(t.factor is not None for t in terms):
            columns["times"] = ["" if t.factor is None else said(t.factor) for t in terms]
        return Table(columns)

    def explain(self) -> Explanation:
        """What the compiler made of the model, and why, in words."""
        compiled = self.compiled()
        from .symbolic.words import told

        return Explanation(self._title(), told(compiled))

    def identifiable(self) -> Identifiability:
        """Which parameters can be found, or which combination cannot, before any data.

        Returns
        -------
        Identifiability
            True if all can.
        """
        compiled = self.compiled()
        from .symbolic.identify import identify

        held = {name for name, given in self.params if not isinstance(given, Free)}
        absent = [p for p in self.all_parameters if p not in compiled.parameters and p not in held]
        return Identifiability(*identify(compiled, tuple(absent)))

    @property
    def _kind(self) -> str:
        return type(self).__name__

    def _compiled(self) -> Compiled:
        raise NotImplementedError

    def _simulated(self) -> Compiled:
        return self._compiled()

    def _title(self) -> tuple[str, ...]:
        raise NotImplementedError

    def _state(self) -> tuple[Any, ...]:
        raise NotImplementedError

    def own_channels(self, rec: Record) -> Record:
        """A record without the outputs and inputs that the model does not name."""
        kept = [name for name in rec.kept if name in self.all_parameters]
        if kept:
            raise SpecError(
                f"{self._kind}: {kept[0]!r} is a parameter of the model and a channel that the record keeps; "
                f"make it an input, rec.select(inputs={[*rec.inputs, kept[0]]}), or name the parameter "
                "otherwise"
            )
        outputs = tuple([name for name in rec.outputs if name in self.outputs])
        inputs = tuple([name for name in rec.inputs if name in self.inputs])
        self._refuse_misspelt((*rec.outputs, *rec.inputs))
        self._refuse_missing(rec.outputs, rec.inputs)
        if (outputs, inputs) == (rec.outputs, rec.inputs):
            return rec
        return rec.select(outputs=outputs, inputs=inputs)

    def _refuse_misspelt(self, channels: tuple[str, ...]) -> None:
        """Refuse parameters that are, in another spelling, a channel which the model leaves out, and pi."""
        if "pi" in channels and any(re.search(r"\bpi\b", text) for text in self._title()):
            raise SpecError(
                f"{self._kind}: 'pi' is a channel of the record and the number 3.14159… in the model; give "
                "the channel another name, or leave it out, rec.select(inputs=[...], outputs=[...])"
            )
        own = {*self.outputs, *self.inputs}
        told = dict(self.params)
        for channel in channels:
            for name in self.all_parameters:
                if channel in own or name in told:
                    continue
                if name == channel:
                    raise SpecError(
                        f"{self._kind}: {name!r} is a channel of the record and would be a parameter of the "
                        f"model; list it, inputs=[{name!r}], or give the parameter another name"
                    )
                if _alike(name, channel):
                    raise SpecError(
                        f"{self._kind}: the record's {channel!r} is in no equation, {name!r} is a parameter; "
                        f"did you mean {channel!r} for {name!r}? Else leave the channel out, "
                        "rec.select(inputs=[...], outputs=[...])"
                    )

    def _match(self, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> None:
        self._refuse_misspelt(inputs)
        self._refuse_missing(outputs, inputs)
        if extra := [name for name in outputs if name not in self.outputs]:
            raise SpecError(
                f"{self._kind}: the model has no output {extra[0]!r}, which the record has; take "
                f"rec.select(outputs={list(self.outputs)})"
            )

    def _refuse_missing(self, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> None:
        """Refuse channels of a record where those of the model are not among them."""
        for what, own, have, other in (
            ("outputs", self.outputs, outputs, inputs),
            ("inputs", self.inputs, inputs, outputs),
        ):
            for name in own:
                if name in have:
                    continue
                if name in other:
                    raise SpecError(
                        f"{self._kind}: {name!r} is among the {what} of the model and not of the record; the "
                        f"record has outputs {list(outputs)} and inputs {list(inputs)}"
                    )
                cure = f"{what}={list(have)}" if have else f"a record with {what}"
                raise SpecError(
                    f"{self._kind}: the model has the {what[:-1]} {name!r}, the record has "
                    f"{what} {list(have)}; write the model in the record's names, with {cure}"
                )

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a {self._kind} cannot be changed")

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self._state() == other._state()

    def __hash__(self) -> int:
        return hash(self._state())


def _alike(name: str, channel: str) -> bool:
    """Whether a name may be a misspelt channel: another case, or one edit of a letter in a longer name."""
    a, b = name.lower(), channel.lower()
    head = _shared(a, b)
    a, b = a[head:], b[head:]
    tail = _shared(a[::-1], b[::-1])
    a, b = a[: len(a) - tail], b[: len(b) - tail]
    if a == b:
        return True
    edit = max(len(a), len(b)) == 1 or (len(a) == 2 and a == b[::-1])
    # Not alpha0 beside alpha, which is a parameter of its own, nor zeta beside beta.
    return edit and head > 0 and min(len(name), len(channel)) > 3 and (a + b).isalpha()


def _shared(a: str, b: str) -> int:
    """Number of letters with which both begin."""
    differ = (k for k, (one, other) in enumerate(zip(a, b, strict=False)) if one != other)
    return next(differ, min(len(a), len(b)))


def channel_names(
    kind: str, what: str, given: Any, count: int | None = None, letter: str = "", *, always: bool = False
) -> tuple[str, ...]:
    """Names of signals as given, or made of a letter and, if there are several or `always`, a number.

    Raises
    ------
    SpecError
        What cannot be a signal's name, or another number of names than `count`.
    """
    if given is None and count is not None:
        return numbered(letter, count) if not always else tuple(f"{letter}{k}" for k in range(1, count + 1))
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        if isinstance(name, str) and iskeyword(name):
            raise SpecError(
                f"{kind}: {what}= has {name!r}, a word of Python, which no signal may be called; take another"
            )
        if not (isinstance(name, str) and re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name)) or name in TAKEN:
            raise SpecError(
                f"{kind}: {what}= has {name!r}, which cannot be a signal's name: take letters, digits and _, "
                f"and none of {', '.join(sorted(TAKEN - FUNCTIONS.keys()))} and the functions"
            )
    if count is not None and len(names) != count:
        raise SpecError(f"{kind}: {what}= has {len(names)} name(s), {count} are needed")
    if len(set(names)) < len(names):
        raise SpecError(f"{kind}: {what}={list(names)} names a signal twice")
    return names


def outputs_left(model: Written, names: Sequence[str]) -> tuple[str, ...]:
    """Outputs of a model but those named.

    Raises
    ------
    SpecError
        Names that are no outputs, or nothing left.
    """
    kind = type(model).__name__
    for name in names:
        if name not in model.outputs:
            raise SpecError(f"{kind}.without: {name!r} is not an output; {nearest(name, model.outputs)}")
    left = tuple(name for name in model.outputs if name not in names)
    if not left:
        raise SpecError(f"{kind}.without: no output is left; name fewer than {', '.join(names)}")
    return left


def parameters_given(given: Any, names: Sequence[str], what: str) -> tuple[tuple[str, float | Free], ...]:
    """params= as pairs.

    Raises
    ------
    SpecError
        A name that is not a parameter, or a value that is neither a finite number nor `Free`.
    """
    if given is None:
        return ()
    if not isinstance(given, Mapping):
        raise SpecError(f'{what}: params={given!r} must map names to values, as {{"a": 0.5}}')
    found: list[tuple[str, float | Free]] = []
    for name, value in given.items():
        if name == "pi":
            raise SpecError(
                f"{what}: params names 'pi', which is the number 3.14159…; give the parameter another name"
            )
        if name not in names:
            raise SpecError(f"{what}: params names {name!r}; {nearest(name, names)}")
        if isinstance(value, Free):
            found.append((name, value))
            continue
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not isfinite(value):
            raise SpecError(
                f"{what}: params[{name!r}]={value!r} must be a finite number (held there) or "
                f"mf.Free(...){bounds_meant(value)}"
            )
        found.append((name, float(value)))
    return tuple(found)
