"""State-space models whose entries are numbers, parameters and expressions of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public
from ..base.arrays import F64
from ..base.named import in_order
from ..errors import SpecError
from ..language.parser import Text, equation
from ..models.free import Free, from_plain, to_plain
from ..systems.lti import LTI
from ..systems.making import linear, ss
from .matrices import (
    Entry,
    Matrix,
    column_of,
    delays_of,
    late_name,
    line,
    matrix_of,
    names_in,
    row_of,
    rows_of,
    state_of,
)
from .written import Written, channel_names, outputs_left, parameters_given

if TYPE_CHECKING:
    from .symbolic.compiled import Compiled

__all__ = ["StateSpace"]

MOST_STATES = 20


@public
class StateSpace(Written):
    """x' = A x + B u, y = C x + D u with entries that are numbers, names or expressions.

    Inputs may be late: u stands for u(t − delay) then.

    Where the states are measured (C without parameters and invertible) the state equations are fitted as they
    stand, stacked. Otherwise states that are not measured are eliminated: one output has
    det(pI − A) y = (C adj(pI − A) B + D det(pI − A)) u, several have equations of lower order each.

    Parameters
    ----------
    A : array_like, shape (n, n)
        Numbers, names of parameters, expressions as text in the language of `Equation`, or SymPy's.
    B : array_like, shape (n, inputs), optional
        Default: no inputs.
    C : array_like, shape (outputs, n), optional
        Default: every state is measured.
    D : array_like, shape (outputs, inputs), optional
        Default: 0.
    states, inputs, outputs : sequence of str, optional
        Default: x1, x2, …; u or u1, u2, …; the states' names for outputs that are states, else y or
        y1, y2, ….
    params : mapping of str to float or Free, optional
        Parameters that are held at a number, or given a start, bounds or a prior, `mf.Free`.
    delay : float, str, or sequence of these, default 0
        Delay of the inputs, s, at least 0; one, or one per input. The name of a parameter estimates it,
        between bounds: ``delay="h", params={"h": mf.Free(min=0, max=0.2)}``.

    Raises
    ------
    SpecError
        Shapes that do not fit, entries outside the language, names that clash.

    See Also
    --------
    modfun.Equation : Any equations.
    modfun.fit : Estimates the parameters.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.8.

    Examples
    --------
    >>> m = StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
    >>> m.outputs
    ('alpha', 'q')
    >>> m.param_names()
    ('Za', 'Ma', 'Mq', 'Zd', 'Md')
    """

    # Records are trimmed: each equation has a constant. Its matrices have poles.
    trend = "constant"
    linear = True

    __slots__ = ()

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    states: tuple[str, ...]
    delay: tuple[Entry, ...]

    def __init__(
        self,
        A: ArrayLike | Sequence[Any],
        B: ArrayLike | Sequence[Any] | None = None,
        C: ArrayLike | Sequence[Any] | None = None,
        D: ArrayLike | Sequence[Any] | None = None,
        *,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        params: Mapping[str, float | Free] | None = None,
        delay: float | str | Sequence[float | str] = 0.0,
    ) -> None:
        n = rows_of(A)
        if not 0 < n <= MOST_STATES:
            raise SpecError(f"StateSpace: A has {n} rows; 1 to {MOST_STATES} states are taken")
        a = matrix_of("A", A, n, n)
        b = matrix_of("B", np.zeros((n, 0)) if B is None else column_of(B, n), n, None)
        k = len(b[0])
        c = matrix_of("C", np.eye(n) if C is None else row_of(C), None, n)
        d = matrix_of("D", np.zeros((len(c), k)) if D is None else row_of(D), len(c), k)
        own = channel_names("StateSpace", "states", states, n, "x", always=True)
        drives = channel_names("StateSpace", "inputs", inputs, k, "u")
        picked = [state_of(c[i], d[i]) for i in range(len(c))]
        natural = None if outputs is None and None in picked else [own[j] for j in picked if j is not None]
        given = natural if outputs is None else outputs
        measured = channel_names("StateSpace", "outputs", given, len(c), "y")
        for i, name in enumerate(measured):
            if name in own and picked[i] != own.index(name):
                renamed = [f"{x}_itself" if x == name else x for x in own]
                raise SpecError(
                    f"StateSpace: the output {name!r} has the name of a state that it is not; its row of C "
                    f"and D shows something else. Name the state otherwise, states={renamed}"
                )
        if twice := [name for name in drives if name in (*own, *measured)]:
            raise SpecError(f"StateSpace: {twice[0]!r} is named twice among states, inputs and outputs")
        late = delays_of(delay, drives)
        names = list(dict.fromkeys(names_in(a, b, c, d, (late,))))
        if clash := [name for name in names if name in (*own, *drives, *measured, "t")]:
            raise SpecError(
                f"StateSpace: {clash[0]!r} stands in a matrix; entries are numbers and parameters, no "
                "signals or t"
            )
        self.__dict__.update(
            A=a,
            B=b,
            C=c,
            D=d,
            states=own,
            inputs=drives,
            outputs=measured,
            delay=late,
            params=parameters_given(params, names, "StateSpace"),
            all_parameters=tuple(names),
        )

    def without(self, *names: str) -> StateSpace:
        """The same system with fewer outputs; what is not measured is eliminated.

        Parameters
        ----------
        *names : str
            Outputs to do without.

        Raises
        ------
        SpecError
            Names that are no outputs, or no output left.
        """
        left = outputs_left(self, names)
        rows = [self.outputs.index(name) for name in left]
        return self._like(C=[self.C[i] for i in rows], D=[self.D[i] for i in rows], outputs=left)

    def _like(self, **changes: Any) -> StateSpace:
        """The same system with some words of the constructor changed."""
        names = ("A", "B", "C", "D", "states", "inputs", "outputs", "delay")
        own: dict[str, Any] = {name: getattr(self, name) for name in names}
        return StateSpace(**own | {"params": dict(self.params)} | changes)

    def model(self, theta: ArrayLike | Mapping[str, float]) -> LTI:
        """The system with these parameters.

        Parameters
        ----------
        theta : array_like, or mapping of str to float
            Parameters in the order of `param_names`, or by name.

        Returns
        -------
        LTI
        """
        names = self.param_names()
        values = np.asarray(in_order("StateSpace.model", theta, names), dtype=np.float64)
        if values.shape != (len(names),):
            raise SpecError(
                f"StateSpace.model: {values.size} numbers for {len(names)} parameters; "
                f"give {', '.join(names)}"
            )
        from .symbolic.linear import numbers

        given = dict(zip(names, values.tolist(), strict=True))
        if lost := self._lost:
            raise SpecError(
                f"StateSpace.model: {', '.join(lost)} cannot be found from {', '.join(self.outputs)}, and so "
                "have no numbers; hold them, params={...}"
            )
        parts = [numbers(matrix, self.params, given) for matrix in (self.A, self.B, self.C, self.D)]
        made = ss(*parts, delay=self._delays(given))
        return replace(made, inputs=self.inputs, outputs=self.outputs)

    @property
    def _lost(self) -> list[str]:
        """Parameters that the outputs do not tell, without which there is no system with numbers."""
        names, params = self.param_names(), dict(self.params)
        return [p for p in self.all_parameters if p not in names and isinstance(params.get(p), Free | None)]

    @property
    def _drives(self) -> tuple[str, ...]:
        """The inputs as they stand in the equations, u(t - h) where one is late."""
        return tuple(map(late_name, self.inputs, self.delay))

    def _delays(self, values: Mapping[str, float]) -> list[float]:
        """Delays of the inputs, s, at values of the parameters that are not held."""
        from .symbolic.linear import numbers

        return numbers((self.delay,), self.params, values).ravel().tolist() if self.delay else []

    def theta(self, system: LTI) -> F64:
        """Parameters of a system with numbers in these matrices, in the order of `param_names`.

        Parameters
        ----------
        system : LTI, or a system of python-control or SciPy
            State space with the states of this one.

        Returns
        -------
        ndarray, shape (p,)

        Raises
        ------
        SpecError
            The system has other matrices than this structure can have, or a parameter stands alone in no
            entry.

        Examples
        --------
        >>> structure = StateSpace([["Zw", 1], ["Mw", "Mq"]], [["Zd"], ["Md"]])
        >>> values = [-1.0, -5.0, -2.0, 0.1, -4.0]
        >>> structure.theta(structure.model(values)).tolist() == values
        True
        """
        system = linear(system, "StateSpace.theta")
        own, names = (self.A, self.B, self.C, self.D), self.param_names()
        late = np.asarray(system.delays)
        found = {}
        if late.shape == (len(self.delay),):
            found = {entry: float(x) for entry, x in zip(self.delay, late, strict=True) if entry in names}
        for matrix, values in zip(own, system.matrices or (), strict=False):
            for row, numbers in zip(matrix, values, strict=False):
                found |= {entry: float(x) for entry, x in zip(row, numbers, strict=False) if entry in names}
        if len(found) == len(names) and system.matrices is not None:
            made = self.model(found)
            here, there = ((*(one.matrices or ()), one.path_delays) for one in (made, system))
            pairs = zip(here, there, strict=True)
            if all(a.shape == b.shape and np.allclose(a, b, rtol=1e-9, atol=1e-12) for a, b in pairs):
                return np.array([found[name] for name in names])
        raise SpecError(
            "StateSpace.theta: the system is none of this structure: its matrices have other numbers or "
            "another shape; give one made by model()"
        )

    def to_dict(self) -> dict[str, Any]:
        """The model as plain Python values, for `from_dict`."""
        values: dict[str, Any] = {name: [list(row) for row in getattr(self, name)] for name in "ABCD"}
        values.update({name: list(getattr(self, name)) for name in ("states", "inputs", "outputs", "delay")})
        return {**values, "params": {name: to_plain(given) for name, given in self.params}}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> StateSpace:
        """The model from what `to_dict` gave.

        Parameters
        ----------
        values : mapping
        """
        params = {name: from_plain(given) for name, given in values["params"].items()}
        return cls(**{**values, "params": params})

    def _compiled(self) -> Compiled:
        return _compiled(self)

    def _title(self) -> tuple[str, ...]:
        signals = (*self.states, *self._drives)
        rows = [
            line(f"{x}'", zip((*a, *b), signals, strict=True))
            for x, a, b in zip(self.states, self.A, self.B, strict=True)
        ]
        rows += [
            line(y, zip((*c, *d), signals, strict=True))
            for y, c, d in zip(self.outputs, self.C, self.D, strict=True)
            if y not in self.states
        ]
        return tuple(rows)

    @property
    def parsed(self) -> tuple[Text, ...]:
        """The equations, as `Equation` has its own."""
        return tuple(equation(text, f"equation {k}") for k, text in enumerate(self._title(), 1))

    def _state(self) -> tuple[Any, ...]:
        matrices = self.A, self.B, self.C, self.D
        return *matrices, self.states, self.inputs, self.outputs, self.delay, self.params

    def __reduce__(self) -> tuple[Any, ...]:
        return StateSpace.from_dict, (self.to_dict(),)

    def __str__(self) -> str:
        """The equations, as `alpha' = Za*alpha + q + Zde*de`."""
        return "; ".join(self._title())

    def __repr__(self) -> str:
        words = [str([list(row) for row in getattr(self, name)]) for name in "ABCD"]
        words += [f"{what}={list(getattr(self, what))}" for what in ("states", "inputs", "outputs")]
        words += [f"params={dict(self.params)}"] if self.params else []
        words += [f"delay={list(self.delay)}"] if any(self.delay) else []
        return f"StateSpace({', '.join(words)})"


@lru_cache(128)
def _compiled(model: StateSpace) -> Compiled:
    from .symbolic.compiler import compile_system
    from .symbolic.linear import system_of

    system = system_of(
        (model.A, model.B, model.C, model.D),
        states=model.states,
        inputs=model.inputs,
        outputs=model.outputs,
        delay=model.delay,
        params=model.params,
        parameters=model.all_parameters,
    )
    return compile_system(system, "StateSpace")
