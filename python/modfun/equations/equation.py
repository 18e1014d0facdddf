"""Models written as equations."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public
from ..base.callables import address, at
from ..base.names import nearest
from ..errors import SpecError
from ..language.parser import EULER, Text, equation
from ..models.free import Free, from_plain, to_plain
from .nonlinear import NonlinearModel, model_of
from .symbolic.known import Samples
from .written import (
    TAKEN,
    Written,
    channel_names,
    outputs_left,
    parameters_given,
)

if TYPE_CHECKING:
    from .symbolic.compiled import Compiled
    from .symbolic.system import System

__all__ = ["Equation"]

Basis = str | Callable[[Any], ArrayLike] | ArrayLike
_EQUALS = re.compile(r"(?<![<>=])=(?!=)")
_OUTPUT, _INPUT = re.compile(r"y\d*"), re.compile(r"u\d*")


@public
class Equation(Written):
    """Differential equations as text, linear or not, one or several that share parameters.

    Parameters
    ----------
    text : str or sequence of str
        Such as ``"y'' + d*y' + a*y + b*y**3 = u"``; several as a list, or as lines of one text.
        Derivatives are primes, on signals, on expressions ``(y**2)'`` and on coefficients ``c(t)'``, or
        ``D(expression, order)``. ``t`` is time in s, ``pi`` the number 3.14159…, never a parameter or a
        signal. ``e`` is a parameter; Euler's number is ``exp(1)``, and ``e**x``, which might be either, is
        refused. ``y(t - h)`` is y delayed by h seconds, a number or a parameter; functions and operators are
        those of input texts (`modfun.language.evaluate.evaluate`). Every other name is a parameter.
        Text is parsed, never executed.
    outputs, inputs : sequence of str, optional
        Measured signals by their names. Default: y, y1, y2, … and u, u1, … as far as they occur; without a y,
        the output is the signal with primes, if there is one such. Outputs are noisy, inputs are known.
    hidden : sequence of str, optional
        Signals that are not measured, which are eliminated. Names with primes that are neither outputs nor
        inputs are hidden without being listed.
    varying : mapping of str to sequence, optional
        Coefficients c(t) = c0·f0(t) + c1·f1(t) + …: for each name the functions f, as text in t, callables of
        an array of instants, or samples (N+1,). Parameters are c0, c1, ….
    params : mapping of str to float or Free, optional
        Parameters that are held at a number, or given a start, bounds or a prior, `mf.Free`.

    Raises
    ------
    SpecError
        Text outside the language, names that clash, `pi` as a parameter or a signal.

    See Also
    --------
    modfun.StateSpace : Matrices with parameters.
    modfun.fit : Estimates the parameters.
    modfun.NonlinearModel : The equations with numbers.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, eq. (1) and sections 3 and 4.8.

    Examples
    --------
    >>> Equation("y'' + d*y' + a*y + b*y**3 = u").param_names()
    ('d', 'a', 'b')
    >>> Equation("q'' + d*q' + k*sin(q) = b*de", outputs=["q"], inputs=["de"]).inputs
    ('de',)
    """

    __slots__ = ()

    texts: tuple[str, ...]
    hidden: tuple[str, ...]
    varying: tuple[tuple[str, tuple[Any, ...]], ...]
    parsed: tuple[Text, ...]

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
        if not isinstance(text, str | Sequence):
            raise SpecError(f'Equation: {text!r} is not an equation; write one as text, "y\' + a*y = b*u"')
        texts = _separate(text) if isinstance(text, str) else tuple(text)
        if not texts:
            raise SpecError('Equation: there is no equation; write one, as "y\' + a*y = b*u"')
        parsed = tuple(
            equation(one, "equation" if len(texts) == 1 else f"equation {k}")
            for k, one in enumerate(texts, 1)
        )
        for one in parsed:
            for node in one.tree.walk():
                if node.is_exponential:
                    one.refuse(node.at, node.end, EULER)
        nodes = [node for one in parsed for node in one.tree.walk() if node.kind == "name"]
        names = list(dict.fromkeys(str(node.value) for node in nodes if node.value not in TAKEN))
        coefficients = _varying(varying)
        given = [
            None if signals is None else channel_names("Equation", what, signals)
            for what, signals in (("outputs", outputs), ("inputs", inputs), ("hidden", hidden))
        ]
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
            if node.primes and name not in (*measured, *unmeasured, *coefficients, *TAKEN):
                unmeasured.append(name)
        if outputs is None and not given[0] and not given[2] and len({*unmeasured}) == 1:
            given[0], measured, unmeasured = (unmeasured[0],), (unmeasured[0], *measured), []
        if not given[0]:
            if not unmeasured and (spelt := _spelt(names)):
                raise SpecError(
                    f"Equation: no signal has a prime; the derivative of {spelt[1]} is written {spelt[1]}', "
                    f"did you mean that for {spelt[0]}?"
                )
            guess = f"outputs=[{unmeasured[0]!r}]" if unmeasured else "outputs=[...]"
            raise SpecError(f"Equation: no signal y occurs; say which signals are measured, {guess}")
        roles = [*measured, *unmeasured, *coefficients]
        if twice := [name for name in roles if roles.count(name) > 1]:
            raise SpecError(
                f"Equation: {twice[0]!r} is named twice among outputs, inputs, hidden and varying"
            )
        for name in (name for name in names if name not in roles):
            signal = next((own for own in roles if name in (f"d{own}", f"{own}dot", f"{own}_dot")), None)
            if signal is not None and (name != f"d{signal}" or "dt" in names):
                raise SpecError(
                    f"Equation: {name!r} would be a parameter; write the derivative of {signal} as {signal}'"
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
            params=parameters_given(params, list(own), "Equation"),
            parsed=parsed,
            all_parameters=tuple(own),
        )

    def without(self, *names: str) -> Equation:
        """The same equations with outputs that are not measured: they are eliminated.

        Parameters
        ----------
        *names : str
            Outputs to do without, because they are too noisy or were not recorded.

        Raises
        ------
        SpecError
            Names that are no outputs, or no output left.
        """
        return self._like(outputs=outputs_left(self, names), hidden=(*self.hidden, *names))

    def _like(self, **changes: Any) -> Equation:
        """The same equations with some words of the constructor changed."""
        own: dict[str, Any] = {name: getattr(self, name) for name in ("outputs", "inputs", "hidden")}
        own |= {"text": self.texts, "varying": dict(self.varying), "params": dict(self.params)}
        return Equation(**own | changes)

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
        return model_of(self.simulated(), params, self)

    def to_latex(self, numbers: Mapping[str, str] | None = None) -> str:
        r"""The equations as LaTeX, as lines aligned at their equals signs.

        Parameters
        ----------
        numbers : mapping of str to str, optional
            What is written in the place of parameters. Default: their names, also where they are held.

        Returns
        -------
        str

        See Also
        --------
        modfun.Fit.to_latex : With the estimates in the place of parameters.

        Examples
        --------
        >>> print(Equation("y'' + d*y' + a*y + b*y**3 = u").to_latex())
        \begin{aligned}
        \ddot{y} + a y + b y^{3} + d \dot{y} &= u
        \end{aligned}
        """
        from .symbolic.latex import written

        channels = (*self.outputs, *self.inputs, *self.hidden)
        return written(self.texts, channels, numbers, [name for name, _ in self.varying])

    def _repr_latex_(self) -> str:
        return f"$${self.to_latex()}$$"

    def to_dict(self) -> dict[str, Any]:
        """The model as plain Python values, for `from_dict`.

        Raises
        ------
        SpecError
            A callable among the varying coefficients that cannot be imported by its name.
        """
        return {
            "text": list(self.texts),
            "outputs": list(self.outputs),
            "inputs": list(self.inputs),
            "hidden": list(self.hidden),
            "varying": {name: [_basis_to_dict(name, one) for one in basis] for name, basis in self.varying},
            "params": {name: to_plain(given) for name, given in self.params},
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Equation:
        """The model from what `to_dict` gave.

        Parameters
        ----------
        values : mapping
        """
        varying = {
            name: [_basis_from_dict(one) for one in basis] for name, basis in values["varying"].items()
        }
        return cls(
            values["text"],
            outputs=values["outputs"],
            inputs=values["inputs"],
            hidden=values["hidden"],
            varying=varying,
            params={name: from_plain(given) for name, given in values["params"].items()},
        )

    def _compiled(self) -> Compiled:
        return _compiled(self)

    def _simulated(self) -> Compiled:
        return _simulated(self)

    def _title(self) -> tuple[str, ...]:
        return self.texts

    def _state(self) -> tuple[Any, ...]:
        return self.texts, self.outputs, self.inputs, self.hidden, self.varying, self.params

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


@lru_cache(128)
def _compiled(model: Equation) -> Compiled:
    from .symbolic.compiler import compile_system

    return compile_system(equations_of(model), "Equation")


@lru_cache(128)
def _simulated(model: Equation) -> Compiled:
    """Compiled, or without terms where hidden signals cannot be eliminated."""
    from .symbolic.compiler import as_written

    try:
        return _compiled(model)
    except SpecError:
        if not model.hidden:
            raise
        return as_written(equations_of(model))


def equations_of(model: Equation) -> System:
    """What the texts of a model say, before anything is eliminated."""
    from .symbolic.system import system_of

    return system_of(
        model.parsed,
        outputs=model.outputs,
        inputs=model.inputs,
        hidden=model.hidden,
        varying=model.varying,
        params=model.params,
        parameters=model.all_parameters,
    )


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


def _spelt(names: Sequence[str]) -> tuple[str, str] | None:
    """What may be a derivative in another spelling, xdot, x_dot or dx/dt, and of which signal."""
    for name in names:
        if (dotted := name.removesuffix("dot").rstrip("_")) and name.endswith("dot"):
            return name, dotted
        if "dt" in names and name.startswith("d") and name not in ("d", "dt"):
            return f"{name}/dt", name[1:]
    return None


def _separate(text: str) -> tuple[str, ...]:
    """The lines of a text that are equations, or the whole of it: one equation may go over several lines."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return tuple(lines) if len(lines) > 1 and all(map(_EQUALS.search, lines)) else (text,)


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
        channel_names("Equation", "varying", [name])
        found[str(name)] = tuple(
            one
            if isinstance(one, str) or callable(one)
            else f"{one}"
            if np.ndim(one) == 0 and isinstance(one, int | float)
            else Samples(one, what)
            for one in basis
        )
    return found


def _basis_to_dict(name: str, given: Any) -> Any:
    if isinstance(given, str):
        return given
    if hasattr(given, "values"):
        return {"samples": given.values.tolist()}
    try:
        return {"function": address(given)}
    except SpecError:
        raise SpecError(
            f"saving an Equation: varying[{name!r}] holds a function that cannot be imported by its name; "
            "define it with def at the top of a module, or write it as text"
        ) from None


def _basis_from_dict(given: Any) -> Any:
    if isinstance(given, str):
        return given
    return given["samples"] if "samples" in given else at(given["function"])
