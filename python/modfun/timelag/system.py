"""Systems with time lag and all that can be asked of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public, reals
from ..base.arrays import C128, F64
from ..base.between import AUTO
from ..base.samples import frequencies
from ..errors import SpecError
from ..systems.frequency_response import FrequencyResponse
from .design import Design, as_design, placed, quadratic
from .loop import simulated
from .motion import Trajectory
from .mu import Margin, Uncertainty, margin
from .plant import Plant, matrices_of
from .roots import characteristic
from .transformation import Transformation, reduced

__all__ = ["DelaySystem"]


@public
class DelaySystem(Plant):
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

    See Also
    --------
    modfun.timelag.from_fit : One of a fit.
    modfun.timelag.equation : What to fit to data.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.10; Y. A. Fiagbedzi, A. E. Pearson,
    Feedback stabilization of linear autonomous time lag systems, IEEE Trans. Autom. Control 31, 1986.

    Examples
    --------
    >>> import modfun as mf
    >>> plant = mf.timelag.DelaySystem(A={0: 1.0}, B={1.0: 1.0})
    >>> design = plant.place([-1.0])
    >>> design.K.round(4)
    array([[5.4366]])
    """

    def frequency_response(self, omega: ArrayLike) -> FrequencyResponse:
        """Frequency response C (iωI − Σ A_k e^{−iωh_k})⁻¹ Σ B_r e^{−iωr}, exact.

        Parameters
        ----------
        omega : array_like
            Angular frequencies, rad/s.

        Returns
        -------
        FrequencyResponse
        """
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
        return reduced(self, keep, count)

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
        return quadratic(self._transformation(transformation, "lqr"), Q, R, line)

    def simulate(
        self,
        K: Any = None,
        *,
        duration: float,
        dt: float,
        history: Any = None,
        initial_state: ArrayLike | None = None,
        u: Any = None,
        input_history: Any = None,
        intersample: str | Sequence[str] = AUTO,
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
        initial_state : array_like, shape (n,), optional
            x at t = 0, where it jumps from its history.
        u : str, callable, array_like or a list of these, optional
            Input from outside, added to the feedback: as in `mf.simulate`.
        input_history : array_like (inputs,) or callable, optional
            u before t = 0. Default 0; text and functions given as u are evaluated there.
        intersample : {"auto", "smooth", "zoh", "foh"} or a sequence of them, default "auto"
            What u from outside does between samples; "auto": as its samples say, see `modfun.Record`, and
            smooth for text and functions.

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
        return simulated(self, K, duration, dt, history, initial_state, u, input_history, intersample)

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
        k, transformation = as_design(self, K)
        blocks = [errors] if isinstance(errors, Uncertainty) else list(errors or [])
        for name, given in (("A", A), ("B", B)):
            for lag, m in matrices_of(f"mu: {name}", given or {}).items():
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
