"""Systems with numbers that need not be linear: equations solved for their highest derivatives, simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import by_name, public, reals
from ..base.arrays import F64
from ..base.between import AUTO
from ..base.samples import steps_of
from ..errors import DataError, SpecError
from ..signals import Signals
from ..signals.sources import Source, is_samples, sources
from ..systems.propagate import intersample_kinds
from .drives import pieces, refined
from .integration import Function, Signal, integrate, signal

if TYPE_CHECKING:
    from .symbolic.compiled import Compiled
    from .symbolic.ode import FirstOrder

__all__ = ["NonlinearModel", "model_of"]


@public
@dataclass(frozen=True, eq=False, repr=False)
class NonlinearModel:
    """Equations with numbers; made by ``Equation.model(params)`` or ``fit.model``.

    Attributes
    ----------
    outputs, inputs : tuple of str
        Channels.
    params : dict of str to float
        Values of the parameters.
    compiled : Compiled
        The equations.
    structure : Equation or StateSpace, optional
        What it is an instance of.

    See Also
    --------
    modfun.Equation : The same without numbers.
    modfun.Fit.model : Where it comes from.
    modfun.simulate : Records of it.

    References
    ----------
    E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, Springer, 1993 (the
    integrator).

    Examples
    --------
    >>> import modfun as mf
    >>> duffing = mf.Equation("y'' + d*y' + a*y + b*y**3 = u").model({"d": 0.3, "a": 1.0, "b": 0.5})
    >>> y = duffing.simulate(u="sin(t)", dt=0.1, intervals=100, initial_state=[0.5, 0.0])
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    params: Mapping[str, float]
    compiled: Compiled
    structure: Any = None

    @property
    def shape(self) -> tuple[int, int]:
        """Number of outputs and of inputs."""
        return len(self.outputs), len(self.inputs)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: "y", "y'", … of the outputs, then of signals that are not measured.

        Where derivatives of an input stand in the equation, they are less what the input feeds through to
        them at once, so that a state is that of the free response, as for `LTI`.
        """
        return self.form.states

    @property
    def form(self) -> FirstOrder:
        """The equations as x' = f(t, x, u)."""
        from .symbolic.ode import first_order

        c = self.compiled
        return first_order(c.source, c.outputs, c.hidden, c.inputs, c.parameters, self._names)

    @property
    def _known(self) -> list[Any]:
        """Known functions of time that stand in the equations."""
        return [self.compiled.known[symbol] for symbol in self._names]

    @property
    def _names(self) -> tuple[Any, ...]:
        used = set().union(*(e.free_symbols for e in self.compiled.source))
        return tuple(symbol for symbol in self.compiled.known if symbol in used)

    def simulate(
        self,
        *,
        u: Any = None,
        dt: float | None = None,
        t: ArrayLike | None = None,
        initial_state: ArrayLike | Mapping[str, float] | None = None,
        intersample: str | Sequence[str] | None = None,
        intervals: int | None = None,
        rtol: float = 1e-9,
    ) -> F64:
        """Response to a sampled or given input.

        Parameters
        ----------
        u : array_like, str, callable, or a list of these, or Signals, optional
            Input: samples (time,) or (input, time), or signals as text or functions of t, one per input; or
            `mf.signals`, which bring dt and intersample. Seen through a delay before the start, samples are
            0, or their first value where `initial_state` is given; text and functions are evaluated there.
            None for a system without inputs.
        dt : float
            Sampling interval, s; the first sample is at t = 0.
        t : array_like, shape (time,)
            Instead of `dt`: the instants of the samples, s, uneven if need be.
        initial_state : array_like, shape (states,), or mapping, optional
            State at the first sample in the order of `states`, or by their names; default: zero. Where the
            equations look back (y(t − h)), the state was the same before.
        intersample : {"auto", "smooth", "zoh", "foh"} or a sequence of them, default "auto"
            What the input does between samples: a cubic spline, held, or straight; "auto": as the
            samples say, see `modfun.Record`, and smooth for text and functions, which is exact.
        intervals : int, optional
            Number of sampling intervals, needed with `dt` where no input is an array.
        rtol : float, default 1e-9
            Relative error of a step of the integration (order 8, adaptive; a stiff system by order 5).

        Returns
        -------
        ndarray, shape (time,) or (output, time)
            Outputs; one-dimensional for one output.

        Raises
        ------
        SpecError
            Arguments that do not fit each other, or equations that cannot be solved.
        DataError
            The response leaves all bounds; the text says when.
        """
        if isinstance(u, Signals):
            u.agree("simulating", dt=dt, intervals=intervals, intersample=intersample)
            u = u.arranged("simulating", self.inputs, len(self.inputs))
            intervals, intersample = u.intervals, u.intersample
            dt = u.dt if t is None else None
        given = sources(u, len(self.inputs))
        kinds = AUTO if intersample is None else intersample
        start = by_name("simulating", "initial_state", initial_state, self.states)
        y = self.respond(given, _grid(dt, t, given, intervals), start, kinds, rtol)
        return y[0] if len(self.outputs) == 1 else y

    def respond(
        self,
        inputs: Sequence[Source],
        grid: F64,
        x0: ArrayLike | None,
        intersample: str | Sequence[str],
        rtol: float = 1e-9,
    ) -> F64:
        """`simulate` with the inputs as a list and the output always (output, time)."""
        return self.trajectory(inputs, grid, x0, intersample, rtol)[0]

    def trajectory(
        self,
        inputs: Sequence[Source],
        grid: F64,
        x0: ArrayLike | None,
        intersample: str | Sequence[str],
        rtol: float = 1e-9,
    ) -> tuple[F64, F64]:
        """As `respond`, with the states (state, time)."""
        n = len(self.states)
        start = np.zeros(n) if x0 is None else reals("simulating", "initial_state", x0)
        if start.shape != (n,) or not np.all(np.isfinite(start)):
            raise SpecError(
                f"simulating: initial_state has shape {start.shape}, the equation has the states "
                f"{', '.join(self.states) or '(none)'}; give {n} finite numbers"
            )
        y, x = self.family(inputs, grid, start[:, None], intersample, rtol, steady=x0 is not None)
        return y[:, 0], x[:, 0]

    def family(
        self,
        inputs: Sequence[Source],
        grid: F64,
        starts: F64,
        intersample: str | Sequence[str],
        rtol: float = 1e-9,
        length: int | None = None,
        params: F64 | None = None,
        steady: bool = True,
    ) -> tuple[F64, F64]:
        """Responses from several initial states, on common steps.

        Common steps make differences of the responses smooth in the starts.

        Parameters
        ----------
        inputs : sequence of Source
            One signal an input.
        grid : ndarray, shape (time,)
            Instants of the samples, s.
        starts : ndarray, shape (state, start)
        intersample : {"smooth", "zoh", "foh"} or a sequence of them
            What the input does between samples.
        rtol : float, default 1e-9
            Relative error of a step.
        length : int, optional
            So many samples of the inputs are run through; default: all.
        params : ndarray, shape (parameter, start), optional
            Parameters of each start's own, delays aside.
        steady : bool, default True
            Before the first sample, inputs were at its value; else at 0.

        Returns
        -------
        y : ndarray, shape (output, start, time)
        x : ndarray, shape (state, start, time)
        """
        form, theta = self.form, list(self.params.values())
        kinds = intersample_kinds(intersample, inputs, grid)
        late = [float(d) for d in form.delays(theta)]
        if any(not (np.isfinite(d) and d >= 0) for d in late):
            raise SpecError(f"simulating: delays are {late} s; a delay is at least 0")
        drives = [
            signal(inputs[d.input], grid, kinds[d.input], d.order, delay, self.inputs[d.input], steady)
            for d, delay in zip(form.drives, late, strict=False)
        ]
        known = [_known(given, grid) for given in self._known]
        pasts = [(p.state, d) for p, d in zip(form.pasts, late[len(drives) :], strict=True)]
        if not len(starts):
            grid, x = grid[:length], np.empty((0, starts.shape[1], grid[:length].size))
            return self._measured(grid, x, drives, known, params), x
        columns = np.tile(np.array(theta)[:, None], starts.shape[1]) if params is None else params
        fine = refined(grid, [*drives, *known], [d for _, d in pasts if d > 0])
        shaped = pieces([*drives, *known], fine)
        grid = grid[:length]
        at = np.searchsorted(fine, grid)
        fine, shaped = fine[: at[-1] + 1], np.ascontiguousarray(shaped[:, : at[-1]])
        x = integrate(form.tape, starts, fine, shaped, pasts, columns, rtol, form.slides)[:, :, at]
        return self._measured(grid, x, drives, known, params), x

    def _measured(self, grid: F64, x: F64, drives: list[Any], known: list[Any], params: F64 | None) -> F64:
        v: list[Any] = [0.0] * (len(drives) + len(self.form.pasts))
        if self.form.feeds:
            v[: len(drives)] = [one(grid) for one in drives]
        k = [one(grid) if self.form.feeds else 0.0 for one in known]
        values = list(self.params.values()) if params is None else list(params[:, :, None])
        found = self.form.outputs(grid, x, v, k, values)
        y = np.empty((len(self.outputs), *x.shape[1:]))
        for row, value in zip(y, found, strict=True):
            row[:] = value
        if not np.all(np.isfinite(y)):
            bad = int(np.argmin(np.isfinite(y).all(axis=(0, 1))))
            raise DataError(
                f"simulating: the output is not finite at t = {grid[bad]:.6g} s; simulate a shorter time, or "
                "check the parameters and the initial state"
            )
        return y

    def __repr__(self) -> str:
        import sympy

        numbers = {sympy.Symbol(name, real=True): value for name, value in self.params.items()}
        lines = []
        for e in self.compiled.source:
            own = {
                s: numbers[sympy.Symbol(s.name, real=True)] for s in e.free_symbols if s.name in self.params
            }
            lines.append(f"{sympy.sstr(e.subs(own).evalf(6), full_prec=False)} = 0")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"


def model_of(compiled: Compiled, values: Any, structure: Any = None) -> NonlinearModel:
    """A system with numbers from compiled equations.

    Parameters
    ----------
    compiled : Compiled
    values : mapping of str to float, or sequence of float
        Parameters by name, or in the order of `compiled.parameters`.
    structure : Equation or StateSpace, optional
        Where they come from.

    Raises
    ------
    SpecError
        A parameter that is missing, unknown or not finite.
    """
    names = compiled.parameters
    if not isinstance(values, Mapping):
        values = dict(zip(names, np.asarray(values, dtype=np.float64).tolist(), strict=True))
    wrong = [n for n in names if n not in values] or [str(n) for n in values if n not in names]
    if wrong:
        raise SpecError(
            f"model: values are given for {', '.join(map(str, values)) or 'nothing'}; the parameters are "
            f"{', '.join(names)}: look at {', '.join(wrong)}"
        )
    numbers = {name: float(values[name]) for name in names}
    bad = [name for name, value in numbers.items() if not np.isfinite(value)]
    if bad:
        raise SpecError(f"model: {', '.join(bad)} must be finite numbers")
    return NonlinearModel(compiled.outputs, compiled.inputs, numbers, compiled, structure)


def _grid(dt: float | None, t: ArrayLike | None, given: Sequence[Source], intervals: int | None) -> F64:
    if (dt is None) == (t is None):
        raise SpecError(
            "simulating: give dt=, the sampling interval in s, or t=, the instants of the samples"
        )
    if t is not None:
        grid = np.ascontiguousarray(reals("simulating", "t", t))
        if grid.ndim != 1 or grid.size < 2 or not np.all(np.diff(grid) > 0):
            raise DataError("simulating: t must be one list of at least two rising instants, in s")
        return grid
    if intervals is None:
        lengths = [np.size(s) for s in given if is_samples(s) and np.ndim(s)]  # type: ignore[arg-type]
        if not lengths:
            raise SpecError(
                "simulating without samples of an input: say how long, intervals=N for N + 1 samples"
            )
        intervals = max(lengths) - 1
    step, count = steps_of(dt, intervals)
    return np.arange(count + 1.0) * step


def _known(given: Any, grid: F64) -> Signal | Function:
    """A known function of time; what is known by samples as a spline through them."""
    from .symbolic.known import Derivative, Samples

    if callable(given) and not isinstance(given, Derivative | Samples):
        return Function(given, 1.0, 0, 0.0)
    values = np.asarray(given(grid) if callable(given) else given, dtype=np.float64)
    if values.shape != grid.shape:
        raise DataError(
            f"simulating: a varying coefficient has {values.size} samples where the record has {grid.size}; "
            "give one per sample, or a function of t"
        )
    return Signal.of(values, grid)
