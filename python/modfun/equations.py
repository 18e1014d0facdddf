"""Models written as equations."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from . import html
from .errors import SpecError
from .extras import optional
from .free import Free
from .symbolic.known import Samples
from .symbolic.parser import CONSTANTS, FUNCTIONS, Text, equation
from .tables import Table, nearest

if TYPE_CHECKING:
    from .nonlinear import NonlinearModel
    from .symbolic.compiled import Compiled

__all__ = ["Equation", "Explanation"]

Basis = str | Callable[[Any], ArrayLike] | ArrayLike
_RESERVED = ("t", "D", *CONSTANTS, *FUNCTIONS)
_OUTPUT, _INPUT = re.compile(r"y\d*"), re.compile(r"u\d*")


class Equation:
    """Differential equations as text, linear or not, one or several that share parameters.

    Parameters
    ----------
    text : str or sequence of str
        Such as ``"y'' + d*y' + a*y + b*y**3 = u"``. Derivatives are primes, on signals, on expressions
        ``(y**2)'`` and on coefficients ``c(t)'``, or ``D(expression, order)``. ``t`` is time in s, ``pi`` and
        ``e`` are numbers, ``y(t - h)`` is y delayed by h seconds, a number or a parameter; functions and
        operators are those of input texts (`modfun.signals.evaluate`). Every other name is a parameter.
        Text is parsed, never executed.
    outputs, inputs : sequence of str, optional
        Measured signals by their names. Default: y, y1, y2, … and u, u1, … as far as they occur. Outputs are
        noisy, inputs are known.
    hidden : sequence of str, optional
        Signals that are not measured, which are eliminated. Names with primes that are neither outputs nor
        inputs are hidden without being listed.
    varying : mapping of str to sequence, optional
        Coefficients c(t) = c0·f0(t) + c1·f1(t) + …: for each name the functions f, as text in t, callables of
        an array of instants, or samples (N+1,). Parameters are c0, c1, ….
    params : mapping of str to float or Free, optional
        Parameters that are held at a number, or given a start and bounds.

    Raises
    ------
    SpecError
        Text outside the language, names that clash.

    Examples
    --------
    >>> Equation("y'' + d*y' + a*y + b*y**3 = u").param_names()
    ('d', 'a', 'b')
    >>> Equation("q'' + d*q' + k*sin(q) = b*de", outputs=["q"], inputs=["de"]).inputs
    ('de',)
    """

    __slots__ = ("__dict__",)

    texts: tuple[str, ...]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    hidden: tuple[str, ...]
    varying: tuple[tuple[str, tuple[Any, ...]], ...]
    params: tuple[tuple[str, float | Free], ...]
    parsed: tuple[Text, ...]
    all_parameters: tuple[str, ...]

    def __init__(
        self,
        text: str | Sequence[str],
        *,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        hidden: Sequence[str] | None = None,
        varying: Mapping[str, Sequence[Basis]] | None = None,
        params: Mapping[str, float | Free] | None = None,
    ) -> None:
        texts = (text,) if isinstance(text, str) else tuple(text)
        if not texts:
            raise SpecError('Equation: there is no equation; write one, as "y\' + a*y = b*u"')
        parsed = tuple(
            equation(one, "equation" if len(texts) == 1 else f"equation {k}")
            for k, one in enumerate(texts, 1)
        )
        nodes = [node for one in parsed for node in one.tree.walk() if node.kind == "name"]
        names = list(dict.fromkeys(str(node.value) for node in nodes if node.value not in _RESERVED))
        coefficients = _varying(varying)
        given = [_names("outputs", outputs), _names("inputs", inputs), _names("hidden", hidden)]
        for k, (what, default) in enumerate((("outputs", _OUTPUT), ("inputs", _INPUT))):
            if given[k] is None:
                taken = {name for other in given if other is not None for name in other}
                free = [n for n in names if default.fullmatch(n) and n not in taken and n not in coefficients]
                given[k] = tuple(sorted(free, key=lambda name: (len(name), name)))
            elif lost := [name for name in given[k] or () if name not in names]:
                raise SpecError(
                    f"Equation: {what}= names {lost[0]!r}, which no equation has; {nearest(lost[0], names)}"
                )
        measured = (*(given[0] or ()), *(given[1] or ()))
        unmeasured = list(given[2] or ())
        for node in nodes:
            name = str(node.value)
            if node.primes and name not in (*measured, *unmeasured, *coefficients, *_RESERVED):
                unmeasured.append(name)
        if not given[0]:
            guess = f"outputs=[{unmeasured[0]!r}]" if unmeasured else "outputs=[...]"
            raise SpecError(f"Equation: no signal y occurs; say which signals are measured, {guess}")
        roles = [*measured, *unmeasured, *coefficients]
        if twice := [name for name in roles if roles.count(name) > 1]:
            raise SpecError(
                f"Equation: {twice[0]!r} is named twice among outputs, inputs, hidden and varying"
            )
        own: dict[str, None] = {}
        for name in names:
            if name in coefficients:
                own.update({f"{name}{k}": None for k in range(len(coefficients[name]))})
            elif name not in roles:
                own[name] = None
        for name, basis in coefficients.items():
            if name not in names:
                raise SpecError(
                    f"Equation: varying= names {name!r}, which no equation has; {nearest(name, names)}"
                )
            if clash := [p for k in range(len(basis)) if (p := f"{name}{k}") in names]:
                raise SpecError(
                    f"Equation: {clash[0]!r} stands in the equation, and is a parameter of {name}(t) = "
                    f"{name}0·f0(t) + …; call one of them otherwise"
                )
        self.__dict__.update(
            texts=texts,
            outputs=given[0],
            inputs=given[1],
            hidden=tuple(unmeasured),
            varying=tuple(coefficients.items()),
            params=_params(params, list(own)),
            parsed=parsed,
            all_parameters=tuple(own),
        )

    def compiled(self, outputs: Sequence[str] | None = None, inputs: Sequence[str] | None = None) -> Compiled:
        """Terms for the channels of a record.

        Parameters
        ----------
        outputs, inputs : sequence of str, optional
            Names of the record's channels; default: the equation's own. Inputs that the equation does not use
            are ignored.

        Returns
        -------
        Compiled

        Raises
        ------
        SpecError
            An equation outside the class, signals that the record has not, outputs that the equation has not.
        ImportError
            Without SymPy (extra ``symbolic``).
        """
        optional("sympy", "symbolic", "Equation")
        compiled = _compiled(self)
        have = self.outputs if outputs is None else tuple(outputs)
        known = self.inputs if inputs is None else tuple(inputs)
        self._match(have, known)
        return replace(compiled, outputs=have, inputs=known)

    def _match(self, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> None:
        for what, own, have, other in (
            ("outputs", self.outputs, outputs, inputs),
            ("inputs", self.inputs, inputs, outputs),
        ):
            for name in own:
                if name in have:
                    continue
                if name in other:
                    raise SpecError(
                        f"Equation: {name!r} is among the {what} of the equation and not of the record; the "
                        f"record has outputs {list(outputs)} and inputs {list(inputs)}"
                    )
                cure = f"{what}={list(have)}" if have else f"a record with {what}"
                raise SpecError(
                    f"Equation: the equation has the {what[:-1]} {name!r}, the record has {what} "
                    f"{list(have)}; write the equation in the record's names, with {cure}"
                )
        if extra := [name for name in outputs if name not in self.outputs]:
            raise SpecError(
                f"Equation: the record's output {extra[0]!r} stands in no equation; take "
                f"rec.select(outputs={list(self.outputs)})"
            )

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

    def model(self, params: Mapping[str, float]) -> NonlinearModel:
        """The equations with numbers: a system to simulate.

        Parameters
        ----------
        params : mapping of str to float
            A value for each of `param_names()`.

        Returns
        -------
        NonlinearModel
        """
        from .nonlinear import model_of

        return model_of(self.compiled(), params, self)

    def terms(self) -> Table:
        """The terms coefficient · operator [signal] that are fitted, p = d/dt; their sum vanishes."""
        from .symbolic.words import operator, said

        terms = self.compiled().terms
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
        """What the compiler made of the equations, and why, in words."""
        from .symbolic.words import told

        return Explanation(self.texts, told(self.compiled()))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError("an Equation cannot be changed")

    def _state(self) -> tuple[Any, ...]:
        return self.texts, self.outputs, self.inputs, self.hidden, self.varying, self.params

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Equation) and self._state() == other._state()

    def __hash__(self) -> int:
        return hash(self._state())

    def __reduce__(self) -> tuple[Any, ...]:
        return _made, self._state()

    def __repr__(self) -> str:
        words = [repr(self.texts[0] if len(self.texts) == 1 else list(self.texts))]
        for what in ("outputs", "inputs", "hidden"):
            if given := getattr(self, what):
                words.append(f"{what}={list(given)}")
        if self.varying:
            words.append(f"varying={ {name: list(basis) for name, basis in self.varying} }")
        if self.params:
            words.append(f"params={dict(self.params)}")
        return f"Equation({', '.join(words)})"


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


@lru_cache(128)
def _compiled(model: Equation) -> Compiled:
    from .symbolic.compiler import compile_system
    from .symbolic.system import system_of

    return compile_system(system_of(model), "Equation")


def _made(
    texts: tuple[str, ...],
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    hidden: tuple[str, ...],
    varying: tuple[tuple[str, tuple[Any, ...]], ...],
    params: tuple[tuple[str, float | Free], ...],
) -> Equation:
    return Equation(
        texts, outputs=outputs, inputs=inputs, hidden=hidden, varying=dict(varying), params=dict(params)
    )


def _names(what: str, given: Any) -> tuple[str, ...] | None:
    if given is None:
        return None
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        if not (isinstance(name, str) and re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name)) or name in _RESERVED:
            raise SpecError(
                f"Equation: {what}= has {name!r}, which cannot be a signal's name: take letters, digits "
                f"and _, and none of {', '.join(_RESERVED[:4])} and the functions"
            )
    return names


def _varying(given: Any) -> dict[str, tuple[Any, ...]]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise SpecError(
            'Equation: varying= must map names to functions of time, as {"c": ["1", "t", "t**2"]}'
        )
    found = {}
    for name, basis in given.items():
        what = f"Equation: varying[{name!r}]"
        if isinstance(basis, str) or callable(basis) or not isinstance(basis, Iterable) or not list(basis):
            raise SpecError(f'{what} must be a list of functions of time, as ["1", "t", "t**2"]')
        _names("varying", [name])
        found[str(name)] = tuple(
            one
            if isinstance(one, str) or callable(one)
            else f"{one}"
            if np.ndim(one) == 0 and isinstance(one, int | float)
            else Samples(one, what)
            for one in basis
        )
    return found


def _params(given: Any, names: Sequence[str]) -> tuple[tuple[str, float | Free], ...]:
    if given is None:
        return ()
    if not isinstance(given, Mapping):
        raise SpecError(f'Equation: params={given!r} must map names to values, as {{"a": 0.5}}')
    found: list[tuple[str, float | Free]] = []
    for name, value in given.items():
        if name not in names:
            raise SpecError(f"Equation: params names {name!r}; {nearest(name, names)}")
        if isinstance(value, Free):
            found.append((name, value))
            continue
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not isfinite(value):
            raise SpecError(
                f"Equation: params[{name!r}]={value!r} must be a finite number (held there) or mf.Free(...)"
            )
        found.append((name, float(value)))
    return tuple(found)
