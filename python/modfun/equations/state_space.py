"""State-space models whose entries are numbers, parameters and expressions of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public, shown
from ..errors import SpecError
from ..language.parser import CONSTANTS, expression
from ..models.free import Free, from_plain, to_plain
from ..systems.lti import LTI
from ..systems.making import ss
from .written import Written, channel_names, outputs_left, parameters_given

if TYPE_CHECKING:
    from .symbolic.compiled import Compiled

__all__ = ["Matrix", "StateSpace"]

Entry = float | str
Matrix = tuple[tuple[Entry, ...], ...]
MOST_STATES = 20


@public
class StateSpace(Written):
    """x' = A x + B u, y = C x + D u with entries that are numbers, names or expressions.

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
        Parameters that are held at a number, or given a start and bounds.

    Raises
    ------
    SpecError
        Shapes that do not fit, entries outside the language, names that clash.

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
    ) -> None:
        n = _rows(A)
        if not 0 < n <= MOST_STATES:
            raise SpecError(f"StateSpace: A has {n} rows; 1 to {MOST_STATES} states are taken")
        a = _matrix("A", A, n, n)
        b = _matrix("B", np.zeros((n, 0)) if B is None else _column(B, n), n, None)
        k = len(b[0])
        c = _matrix("C", np.eye(n) if C is None else _row(C), None, n)
        d = _matrix("D", np.zeros((len(c), k)) if D is None else _row(D), len(c), k)
        own = channel_names("StateSpace", "states", states, n, "x", always=True)
        drives = channel_names("StateSpace", "inputs", inputs, k, "u")
        picked = [_picked(c[i], d[i]) for i in range(len(c))]
        natural = None if outputs is None and None in picked else [own[j] for j in picked if j is not None]
        given = natural if outputs is None else outputs
        measured = channel_names("StateSpace", "outputs", given, len(c), "y")
        for i, name in enumerate(measured):
            if name in own and picked[i] != own.index(name):
                raise SpecError(f"StateSpace: the output {name!r} has the name of a state that it is not")
        if twice := [name for name in drives if name in (*own, *measured)]:
            raise SpecError(f"StateSpace: {twice[0]!r} is named twice among states, inputs and outputs")
        names = list(dict.fromkeys(_names_of(a, b, c, d)))
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
        return StateSpace(
            self.A,
            self.B,
            [self.C[i] for i in rows],
            [self.D[i] for i in rows],
            states=self.states,
            inputs=self.inputs,
            outputs=left,
            params=dict(self.params),
        )

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
        if isinstance(theta, Mapping):
            if lost := [name for name in (*names, *theta) if name not in theta or name not in names]:
                raise SpecError(f"StateSpace.model: {lost[0]!r}; the parameters are {', '.join(names)}")
            theta = [theta[name] for name in names]
        values = np.asarray(theta, dtype=np.float64)
        if values.shape != (len(names),):
            raise SpecError(
                f"StateSpace.model: {values.size} numbers for {len(names)} parameters; "
                f"give {', '.join(names)}"
            )
        from .symbolic.linear import numbers

        given = dict(zip(names, values.tolist(), strict=True))
        if lost := [
            p
            for p in self.all_parameters
            if p not in names and isinstance(dict(self.params).get(p), Free | None)
        ]:
            raise SpecError(
                f"StateSpace.model: {', '.join(lost)} cannot be found from {', '.join(self.outputs)}, and so "
                "have no numbers; hold them, params={...}"
            )
        made = ss(*(numbers(matrix, self, given) for matrix in (self.A, self.B, self.C, self.D)))
        return replace(made, inputs=self.inputs)

    def to_dict(self) -> dict[str, Any]:
        """The model as plain Python values, for `from_dict`."""
        values: dict[str, Any] = {name: [list(row) for row in getattr(self, name)] for name in "ABCD"}
        values.update({name: list(getattr(self, name)) for name in ("states", "inputs", "outputs")})
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
        rows = [_line(f"{x}'", a, b, self) for x, a, b in zip(self.states, self.A, self.B, strict=True)]
        rows += [
            _line(y, c, d, self)
            for y, c, d in zip(self.outputs, self.C, self.D, strict=True)
            if y not in self.states
        ]
        return tuple(rows)

    def _state(self) -> tuple[Any, ...]:
        return self.A, self.B, self.C, self.D, self.states, self.inputs, self.outputs, self.params

    def __reduce__(self) -> tuple[Any, ...]:
        return StateSpace.from_dict, (self.to_dict(),)

    def __str__(self) -> str:
        """The equations, as `alpha' = Za*alpha + q + Zde*de`."""
        return "; ".join(self._title())

    def __repr__(self) -> str:
        words = [str([list(row) for row in getattr(self, name)]) for name in "ABCD"]
        words += [f"{what}={list(getattr(self, what))}" for what in ("states", "inputs", "outputs")]
        words += [f"params={dict(self.params)}"] if self.params else []
        return f"StateSpace({', '.join(words)})"


@lru_cache(128)
def _compiled(model: StateSpace) -> Compiled:
    from .symbolic.compiler import compile_system
    from .symbolic.linear import system_of

    return compile_system(system_of(model), "StateSpace")


def _rows(matrix: Any) -> int:
    try:
        return len(matrix)
    except Exception:  # of whatever an unknown object raises
        raise SpecError(
            f"StateSpace: A={shown(matrix)} is no matrix; give rows of numbers and names"
        ) from None


def _matrix(name: str, given: Any, rows: int | None, columns: int | None) -> Matrix:
    try:
        table = [list(row) for row in given]
    except TypeError:
        raise SpecError(f"StateSpace: {name} must be a matrix, a list of rows") from None
    shape = (len(table), len(table[0]) if table else 0)
    wanted = (shape[0] if rows is None else rows, shape[1] if columns is None else columns)
    if uneven := [k for k, row in enumerate(table) if len(row) != shape[1]]:
        raise SpecError(
            f"StateSpace: row {uneven[0] + 1} of {name} has {len(table[uneven[0]])} entries, its first "
            f"row {shape[1]}"
        )
    if shape != wanted or not table:
        raise SpecError(f"StateSpace: {name} has shape {shape}, with this A it is {wanted}")
    return tuple(
        tuple(_entry(f"{name}[{i}][{j}]", one) for j, one in enumerate(row)) for i, row in enumerate(table)
    )


def _entry(where: str, given: Any) -> Entry:
    if isinstance(given, str):
        source = expression(given, f"entry {where}")
        for node in source.tree.walk():
            if node.kind in ("prime", "compare") or node.primes or (node.kind == "name" and node.parts):
                source.refuse(node.at, node.end, "is no number or parameter; a matrix has no signals")
        return float(given) if source.tree.kind == "number" else given
    if type(given).__module__.partition(".")[0] == "sympy":
        from .symbolic.words import said

        return _entry(where, said(given, exact=True))
    try:
        if isinstance(given, bool) or given is np.ma.masked:
            raise TypeError
        number = float(given)
    except Exception:  # of whatever the conversion of an unknown object raises
        raise SpecError(
            f"StateSpace: {where} is {shown(given)}; give a number, a name or an expression"
        ) from None
    if not np.isfinite(number):
        raise SpecError(f"StateSpace: {where} is {number}; entries are finite")
    return number


def _column(given: Any, n: int) -> Any:
    """B of one input may be given as n entries."""
    flat = _is_flat("B", given)
    return [[one] for one in given] if flat and len(given) == n else given


def _row(given: Any) -> Any:
    """C or D of one output may be given as a row."""
    return [given] if _is_flat("C or D", given) else given


def _is_flat(name: str, given: Any) -> bool:
    try:
        return all(isinstance(one, str) or np.ndim(one) == 0 for one in given)
    except Exception:  # of whatever an unknown object raises
        raise SpecError(f"StateSpace: {name}={shown(given)} is no matrix; give rows") from None


def _picked(c: Sequence[Entry], d: Sequence[Entry]) -> int | None:
    """The state that an output is, if it is one."""
    set_ = [j for j, one in enumerate(c) if one != 0]
    return set_[0] if len(set_) == 1 and c[set_[0]] == 1 and all(one == 0 for one in d) else None


def _names_of(*matrices: Matrix) -> list[str]:
    texts = [one for matrix in matrices for row in matrix for one in row if isinstance(one, str)]
    nodes = [node for text in texts for node in expression(text).tree.walk() if node.kind == "name"]
    return [str(node.value) for node in nodes if node.value not in CONSTANTS]


def _line(left: str, own: Sequence[Entry], driven: Sequence[Entry], model: StateSpace) -> str:
    parts = []
    for entry, name in [*zip(own, model.states, strict=True), *zip(driven, model.inputs, strict=True)]:
        if entry == 0:
            continue
        if entry == 1:
            parts.append(name)
            continue
        text = entry if isinstance(entry, str) else f"{entry:g}"
        parts.append(f"{text if text.isalnum() or not isinstance(entry, str) else f'({text})'}*{name}")
    return f"{left} = {' + '.join(parts) or '0'}"
