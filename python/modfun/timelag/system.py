"""Systems with time lag: matrices by lag, and all that can be asked of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arguments import public, real, reals
from ..base.samples import frequencies
from ..errors import SpecError

if TYPE_CHECKING:
    from .design import Design
    from .motion import Trajectory
    from .mu import Margin
    from .roots import Lagged, Roots
    from .transformation import Transformation

__all__ = ["DelaySystem", "Uncertainty"]

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]


@public
class DelaySystem:
    """x'(t) = Σ A_k x(t − h_k) + Σ B_r u(t − r), y = Cx, with numbers.

    Parameters
    ----------
    A : mapping of float to array_like
        Matrices (n, n) by lag, s, at least 0; numbers where n = 1. A matrix alone has lag 0.
    B : mapping of float to array_like, optional
        Matrices (n, inputs) by lag; vectors are one input. Default: no inputs.
    C : array_like, shape (outputs, n), optional
        Default: the states.
    states, inputs : sequence of str, optional
        Names; default x1, x2, … and u or u1, u2, ….

    Raises
    ------
    SpecError
        Lags below 0, matrices that do not fit each other or are not finite.

    Examples
    --------
    >>> import modfun as mf
    >>> plant = mf.timelag.DelaySystem(A={0: 1.0}, B={1.0: 1.0})
    >>> design = plant.place([-1.0])
    >>> design.K.round(4)
    array([[5.4366]])
    """

    a: Lagged
    b: Lagged
    C: F64
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __init__(
        self,
        A: Mapping[float, ArrayLike] | ArrayLike,
        B: Mapping[float, ArrayLike] | ArrayLike | None = None,
        C: ArrayLike | None = None,
        *,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
    ) -> None:
        from ..equations.written import channel_names

        a = _lagged("A", A, None)
        n = len(a[0][1])
        b = _lagged("B", np.zeros((n, 0)) if B is None else B, n)
        own = channel_names("DelaySystem", "states", states, n, "x", always=True)
        c = np.eye(n) if C is None else np.atleast_2d(reals("DelaySystem", "C", C))
        if c.ndim != 2 or c.shape[1] != n or not np.all(np.isfinite(c)):
            raise SpecError(
                f"DelaySystem: C has shape {c.shape}; with {n} states it is (outputs, {n}), finite"
            )
        c = c.copy()
        c.flags.writeable = False
        self.__dict__.update(
            a=a,
            b=b,
            C=c,
            states=own,
            inputs=channel_names("DelaySystem", "inputs", inputs, b[0][1].shape[1], "u"),
            outputs=own if C is None else channel_names("DelaySystem", "outputs", None, len(c), "y"),
        )

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError("a DelaySystem cannot be changed; make a new one")

    @property
    def A(self) -> dict[float, F64]:
        """Matrices of x by lag, s."""
        return dict(self.a)

    @property
    def B(self) -> dict[float, F64]:
        """Matrices of u by lag, s."""
        return dict(self.b)

    @property
    def order(self) -> int:
        """Number of states n: as many roots can be moved."""
        return len(self.a[0][1])

    @property
    def shape(self) -> tuple[int, int]:
        """Number of outputs and of inputs."""
        return len(self.C), self.b[0][1].shape[1]

    def poles(self, count: int = 20) -> Roots:
        """Rightmost characteristic roots, each with its residual, counted by the argument principle.

        Parameters
        ----------
        count : int, default 20
            How many at least; pairs are not cut, and a system may have fewer.

        Returns
        -------
        Roots
            An array of complex numbers, rad/s, that prints as a table.

        Warns
        -----
        ModfunWarning
            The argument principle counts others than were found.
        """
        from .roots import rightmost

        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
            raise SpecError(f"poles: count={count!r} must be a whole number of at least 1")
        kept: dict[int, Roots] = self.__dict__.setdefault("_roots", {})
        if count not in kept:
            kept[count] = rightmost(self.a, int(count))
        return kept[count]

    def frequency_response(self, omega: ArrayLike) -> Any:
        """Frequency response C (iωI − Σ A_k e^{−iωh_k})⁻¹ Σ B_r e^{−iωr}, exact.

        Parameters
        ----------
        omega : array_like
            Angular frequencies, rad/s.

        Returns
        -------
        FrequencyResponse
        """
        from ..systems.frequency_response import FrequencyResponse
        from .roots import characteristic

        w = frequencies(omega, "frequency_response")
        s = np.asarray(1j * w, dtype=np.complex128)
        drive = np.sum([np.exp(-s * r)[:, None, None] * m for r, m in self.b], axis=0)
        found: C128 = self.C @ np.linalg.solve(characteristic(self.a, s), drive)
        return FrequencyResponse(omega=w, response=found.transpose(1, 2, 0))

    def transformation(
        self, keep: Sequence[complex] | None = None, *, count: int | None = None
    ) -> Transformation:
        """The reducing transformation to z' = Az + Bu.

        Parameters
        ----------
        keep : sequence of complex, optional
            The n roots that A shall have, near enough to be told; pairs together. Default: the rightmost
            with independent left null vectors, unstable and slow ones first.
        count : int, optional
            Roots to look at; default 4n + 8.

        Returns
        -------
        Transformation

        Raises
        ------
        SpecError
            There are no n such roots; those at fault are named.
        """
        from .transformation import reduced

        return reduced(self, self.poles(4 * self.order + 8 if count is None else count), keep)

    def place(
        self,
        poles: ArrayLike,
        *,
        line: float = 0.0,
        transformation: Transformation | None = None,
    ) -> Design:
        """Feedback u = −Kz that moves the kept roots to `poles`.

        Parameters
        ----------
        poles : array_like of complex, shape (n,)
            Complex ones with their conjugates.
        line : float, default 0
            No root of the loop that stays may have a real part here or above, 1/s.
        transformation : Transformation, optional
            As from `transformation(keep=...)`; default: the one of the rightmost roots.

        Returns
        -------
        Design
            An array K, with the transformation it belongs to.

        Raises
        ------
        SpecError
            More than n roots right of the line, a root that no input reaches, poles that cannot be had;
            each named.
        """
        from .design import placed

        return placed(self._transformation(transformation, "place"), poles, line)

    def lqr(
        self,
        Q: ArrayLike,
        R: ArrayLike,
        *,
        line: float = 0.0,
        transformation: Transformation | None = None,
    ) -> Design:
        """Feedback u = −Kz that minimises ∫ z'Qz + u'Ru.

        Parameters
        ----------
        Q : array_like
            A number, n numbers or a symmetric (n, n) matrix, positive semidefinite.
        R : array_like
            A number, numbers or a matrix of the inputs, positive definite.
        line, transformation
            As in `place`.

        Returns
        -------
        Design

        Raises
        ------
        SpecError
            As in `place`, and for weights that are none.
        """
        from .design import quadratic

        return quadratic(self._transformation(transformation, "lqr"), Q, R, line)

    def simulate(
        self,
        K: Any = None,
        *,
        duration: float,
        dt: float,
        history: Any = None,
        x0: ArrayLike | None = None,
        u: Any = None,
        input_history: Any = None,
        intersample: str | Sequence[str] = "smooth",
    ) -> Trajectory:
        """Response of the delay equation itself, open loop or under sampled feedback.

        Parameters
        ----------
        K : Design, array_like (inputs, n), or callable, optional
            Feedback u = −Kz, computed at each sample from samples of x and held until the next; see
            `Design.controller`. A callable is a law of your own, ``K(t, state, held)`` with the functions
            state(instants) and held(instants), (channel, time), of the past; it returns u. Default: no
            feedback.
        duration, dt : float
            Length and sampling interval, s; the last sample is at the largest multiple of dt within.
        history : array_like (n,) or callable, optional
            x before t = 0: constant, or a function of an array of instants that gives (n, time). Default 0.
        x0 : array_like, shape (n,), optional
            x at t = 0, where it jumps from its history.
        u : str, callable, array_like or a list of these, optional
            Input from outside, added to the feedback: as in `mf.simulate`.
        input_history : array_like (inputs,) or callable, optional
            u before t = 0. Default 0; text and functions given as u are evaluated there.
        intersample : {"smooth", "zoh", "foh"} or a sequence of them
            What u from outside does between samples.

        Returns
        -------
        Trajectory

        Raises
        ------
        SpecError, DataError
            Arguments that do not fit, or a response that overflows.

        Warns
        -----
        ModfunWarning
            Held for so long, u does not stabilise the roots it moves.
        """
        from .loop import simulated

        return simulated(self, K, duration, dt, history, x0, u, input_history, intersample)

    def mu(
        self,
        K: Any,
        errors: Sequence[Uncertainty] | Uncertainty | None = None,
        *,
        A: Mapping[float, ArrayLike] | None = None,
        B: Mapping[float, ArrayLike] | None = None,
        omega: ArrayLike | None = None,
    ) -> Margin:
        """Upper bound of the structured singular value of the loop u = −Kz, by D-scaling.

        The bound holds for errors of the plant's matrices while the controller keeps the nominal ones; lags
        and what sampling does are not among the errors. A real error is bounded as if it were complex, so
        that the loop may bear more than `margin` says. The peak is sought on a grid of frequencies.

        Parameters
        ----------
        K : Design or array_like (inputs, n)
        errors : Uncertainty or sequence of Uncertainty, optional
            What may be wrong, each at its full size for μ = 1.
        A, B : mapping of float to array_like, optional
            Instead, half-widths of the entries by lag: each entry that is not 0 errs on its own.
        omega : array_like, optional
            Frequencies, rad/s. Default: 0 and a grid over all that the loop may respond to, refined at the
            peak.

        Returns
        -------
        Margin

        Raises
        ------
        SpecError
            Errors that do not fit the plant, a loop that is not stable without them.
        """
        from .design import as_design
        from .mu import margin

        k, transformation = as_design(self, K)
        blocks = [errors] if isinstance(errors, Uncertainty) else list(errors or [])
        for name, given in (("A", A), ("B", B)):
            for lag, m in _matrices(f"mu: {name}", given or {}).items():
                for i, j in zip(*np.nonzero(m), strict=True):
                    unit = np.zeros_like(m)
                    unit[i, j] = abs(m[i, j])
                    own = {lag: unit}
                    blocks.append(Uncertainty(A=own) if name == "A" else Uncertainty(B=own))
        if not blocks:
            raise SpecError("mu: nothing is uncertain; give errors=, or half-widths A= and B= by lag")
        grid = None if omega is None else np.atleast_1d(reals("mu", "omega", omega))
        if grid is not None and (grid.ndim != 1 or not grid.size or not np.all(np.isfinite(grid))):
            raise SpecError("mu: omega must be one list of finite angular frequencies in rad/s")
        return margin(self, k, transformation, blocks, grid)

    def trajectory(
        self, inputs: Sequence[Any], grid: F64, x0: ArrayLike, intersample: str | Sequence[str]
    ) -> tuple[F64, F64]:
        """Outputs and states (channel, time) at even instants from 0 on, x0 before and at t = 0."""
        run = self.simulate(
            duration=float(grid[-1]),
            dt=float(grid[1] - grid[0]),
            history=x0,
            u=list(inputs) if inputs else None,
            intersample=intersample,
        )
        return run.y, run.x

    def respond(
        self, inputs: Sequence[Any], grid: F64, x0: ArrayLike, intersample: str | Sequence[str]
    ) -> F64:
        """`trajectory` without the states."""
        return self.trajectory(inputs, grid, x0, intersample)[0]

    def _transformation(self, given: Transformation | None, what: str) -> Transformation:
        if not self.shape[1]:
            raise SpecError(f"{what}: the system has no inputs; give B")
        if given is None:
            return self.transformation()
        if getattr(given, "plant", None) is not self:
            raise SpecError(f"{what}: the transformation belongs to another system")
        return given

    def __repr__(self) -> str:
        parts = [f"x' = {' + '.join([*_terms('A', 'x', self.a), *_terms('B', 'u', self.b)])}"]
        for name, matrices in (("A", self.a), ("B", self.b)):
            parts += [f"{name}[{lag:g}] =\n{m}" for lag, m in matrices if m.size]
        return "\n".join(parts)

    def _repr_html_(self) -> str:
        from html import escape

        return f"<pre>{escape(repr(self))}</pre>"


@public
@dataclass(frozen=True, eq=False)
class Uncertainty:
    """One error of a plant's matrices, for `DelaySystem.mu`.

    A scalar δ, `|δ| ≤ 1`, that is "real" or "complex", times the matrices given: A_k + δ·A[k], B_r + δ·B[r],
    the same δ in all of them, as a physical parameter has it. Or a "full" block: any matrix Δ with
    ‖Δ‖₂ ≤ 1, as A_k + Δ·A[k], B_r + Δ·B[r].

    Parameters
    ----------
    A, B : mapping of float to array_like, optional
        Matrices by lag, s.
    kind : {"real", "complex", "full"}, default "real"

    Raises
    ------
    SpecError
        Another kind, or matrices that are none.
    """

    A: Mapping[float, Any] = field(default_factory=dict)
    B: Mapping[float, Any] = field(default_factory=dict)
    kind: str = "real"

    def __post_init__(self) -> None:
        if self.kind not in ("real", "complex", "full"):
            raise SpecError(f'Uncertainty: kind={self.kind!r}; choose among "real", "complex", "full"')
        object.__setattr__(self, "A", _matrices("Uncertainty: A", self.A))
        object.__setattr__(self, "B", _matrices("Uncertainty: B", self.B))
        if not self.A and not self.B:
            raise SpecError("Uncertainty: give A= or B=, matrices by lag")


def _terms(name: str, signal: str, matrices: Lagged) -> list[str]:
    return [f"{name}[{lag:g}] {signal}(t{f' - {lag:g}' if lag else ''})" for lag, m in matrices if m.size]


def _lagged(name: str, given: Any, n: int | None) -> Lagged:
    """Matrices by rising lag, that of lag 0 among them; B has the rows of A."""
    found = _matrices(f"DelaySystem: {name}", given if isinstance(given, Mapping) else {0.0: given})
    if not found:
        raise SpecError(f"DelaySystem: {name} is empty; give at least one matrix, as {{0: ...}}")
    first = next(iter(found.values()))
    shape = (len(first), len(first)) if n is None else (n, first.shape[1])
    for lag, m in found.items():
        if m.shape != shape or not shape[0]:
            raise SpecError(
                f"DelaySystem: {name}[{lag:g}] has shape {m.shape}; beside the others it must be {shape}"
            )
    found.setdefault(0.0, np.zeros(shape))
    for m in found.values():
        m.flags.writeable = False
    return tuple(sorted(found.items()))


def _matrices(what: str, given: Any) -> dict[float, F64]:
    """Matrices by lag, checked one by one; a vector is a column."""
    if not isinstance(given, Mapping):
        raise SpecError(f"{what} must map lags in seconds to matrices, as {{0: ..., 1.0: ...}}")
    found: dict[float, F64] = {}
    for lag, matrix in given.items():
        if not 0 <= real(what, "a lag", lag) < np.inf:
            raise SpecError(f"{what} has the lag {lag!r}; a lag is a time in seconds, at least 0")
        m = reals(what, f"[{lag:g}]", matrix).copy()
        m = m.reshape(1, 1) if m.ndim == 0 else m[:, None] if m.ndim == 1 else m
        if m.ndim != 2 or not np.all(np.isfinite(m)):
            raise SpecError(f"{what}[{lag:g}] must be a matrix of finite numbers, its shape is {m.shape}")
        found[float(lag)] = m
    return found
