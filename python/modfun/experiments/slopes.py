"""Responses of models to records' inputs, with their derivatives to parameters and initial state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import F64
from ..equations.nonlinear import NonlinearModel
from ..equations.state_space import StateSpace
from ..errors import DataError, SpecError
from ..models.layout import Layout
from ..models.transfer_function import system_of
from ..records.record import Record
from ..systems.lti import LTI
from ..systems.making import named, ss
from ..systems.polynomials import time_unit
from ..systems.propagate import Inputs, respond
from .sensitivities import Sensitivities

__all__ = ["Equations", "Known", "Slopes", "States", "Transfers"]

STEP = 1e-4  # of a parameter's size: differences on common steps, exact to its square


@dataclass(frozen=True, eq=False)
class Slopes:
    """A response and its derivatives at the samples of a record.

    Attributes
    ----------
    y : ndarray, shape (output, time)
    params : ndarray, shape (parameter, output, time)
    state : ndarray, shape (state, output, time)
    """

    y: F64
    params: F64
    state: F64


def _beyond_first(u: F64) -> F64:
    """Inputs that stood at their first value before the record: a delay does not move a jump to it."""
    return u - u[:, :1]


class Transfers:
    """A transfer function with values; each output has an initial state of its own, y, y', ….

    Like `States` and `Equations` it has names and `values` of its parameters, names of outputs and inputs
    (None: whatever the record has), `shape` (number of outputs and of inputs), and `accuracy`, the relative
    error of its derivatives.
    """

    accuracy = 1e-12

    def __init__(self, layout: Layout, values: F64, inputs: tuple[str, ...] | None = None) -> None:
        self.layout, self.values, self.names = layout, values, layout.param_names
        self.outputs: tuple[str, ...] | None = None
        self.inputs = inputs
        self.shape = len(layout.outputs), len(layout.inputs)

    def system(self, values: F64) -> LTI:
        """The system with other values of the parameters."""
        return named(system_of(self.layout, values), self.layout.outputs, self.layout.inputs)

    def slopes(self, rec: Record, start: F64 | None, held: bool = True) -> Slopes:
        layout, samples = self.layout, rec.t.size
        states = sum(layout.orders)
        begin = np.zeros(states) if start is None else _checked(start, states)
        y = np.empty((len(layout.outputs), samples))
        coefficients = np.zeros((len(layout.names), *y.shape))
        late = np.zeros((len(layout.free_delays), *y.shape))
        state = np.zeros((states, *y.shape))
        first = 0
        for i, n in enumerate(layout.orders):
            own = slice(first, first + n)
            y[i], rows, state[own, i] = self._output(rec.u, rec, i, begin[own], held)
            moved = rows
            if held and layout.free_delays:
                moved = self._output(_beyond_first(rec.u), rec, i, begin[own], held)[1]
            first += n
            dens, nums = layout.places
            coefficients[dens[i] : dens[i] + n, i] = rows[:n]
            at = n
            _, numerators = layout.polynomials(self.values, i)
            for k, degree in enumerate(layout.numerators[i]):
                if degree is None:
                    continue
                path = layout.routes[i][k]
                if path in layout.free_delays:
                    # ∂/∂τ of b(s) U e^(−τs)/A is −s times it: the rows one power higher.
                    late[layout.free_delays.index(path), i] -= numerators[k] @ moved[at : at + degree + 1]
                    at += 1
                coefficients[nums[i][k] : nums[i][k] + degree + 1, i] = rows[at : at + degree + 1]
                at += degree + 1
        return Slopes(y, np.concatenate([coefficients[list(layout.free)], late]), state)

    def _output(self, u: F64, rec: Record, output: int, start: F64, held: bool) -> tuple[F64, F64, F64]:
        """Response of an output to inputs, its derivatives to coefficients (one power more where a delay is
        free) and to its states."""
        layout = self.layout
        n, degrees = layout.orders[output], list(layout.numerators[output])
        den, numerators = layout.polynomials(self.values, output)
        theta = [den[1:]]
        for k, degree in enumerate(degrees):
            if degree is None:
                continue
            free = layout.routes[output][k] in layout.free_delays
            if free and degree == n:
                raise SpecError(
                    f"crlb: input {layout.inputs[k]!r} feeds through to {layout.outputs[output]!r} after "
                    "an unknown delay, and a response that jumps has no derivative to it: hold the delay, "
                    "or lower zeros="
                )
            degrees[k] = degree + free
            theta += [np.zeros(int(free)), numerators[k]]
        delays = layout.delays(self.values, output)
        prepared = Inputs(list(u), float(rec.dt or 0), rec.intervals, rec.intersample, delays, held)
        omega = time_unit(den)
        engine = Sensitivities(n, degrees, prepared, omega)
        # T(s) of the states, y⁽ʲ⁾(0) by a_(k−j), in powers of s counted in omega.
        to_transient = np.array([np.concatenate([np.zeros(j), den[: n - j]]) for j in range(n)]).T
        to_transient = omega ** -np.arange(float(n))[:, None] * to_transient
        y, jacobian = engine.run(np.concatenate(theta) * engine.scale, to_transient @ start)
        count = engine.scale.size
        # The transient of given states depends on the denominator, too.
        rows = jacobian[:count] * engine.scale[:, None]
        free_rows = omega ** -np.arange(float(n))[:, None] * jacobian[count:]
        for j in range(1, n):
            rows[j - 1] += start[: n - j] @ free_rows[j:]
        return y, rows, to_transient.T @ jacobian[count:]


class States:
    """A StateSpace with values; all its equations share one initial state."""

    accuracy = 1e-12

    def __init__(
        self, model: StateSpace, values: Mapping[str, float], outputs: Sequence[str] | None = None
    ) -> None:
        from ..equations.symbolic.linear import derivatives, numbers

        self.names = tuple(values)
        self.values = np.array([float(value) for value in values.values()])
        self.outputs: tuple[str, ...] | None = model.outputs if outputs is None else tuple(outputs)
        self.inputs: tuple[str, ...] | None = model.inputs
        rows = [model.outputs.index(name) for name in self.outputs or ()]
        self.shape = len(rows), len(model.inputs)
        matrices = [model.A, model.B, model.C, model.D]
        self.model = model
        self.rows = rows
        self.matrices = [numbers(m, model.params, values) for m in matrices]
        self.moved = [derivatives(m, model.params, values) for m in matrices]
        self.late = tuple(model._delays(values))
        for k in (2, 3):
            self.matrices[k] = self.matrices[k][rows]
            self.moved[k] = self.moved[k][:, rows]

    def system(self, values: F64) -> LTI:
        """The system with other values of the parameters."""
        from ..equations.symbolic.linear import numbers

        given = dict(zip(self.names, values.tolist(), strict=True))
        a, b, c, d = (
            numbers(m, self.model.params, given)
            for m in (self.model.A, self.model.B, self.model.C, self.model.D)
        )
        made = ss(a, b, c[self.rows], d[self.rows], delay=self.model._delays(given))
        return replace(made, inputs=self.inputs, outputs=self.outputs)

    def slopes(self, rec: Record, start: F64 | None, held: bool = True) -> Slopes:
        (a, b, c, d), (da, db, dc, dd) = self.matrices, self.moved
        n, q, p = a.shape[0], c.shape[0], self.values.size
        words = (float(rec.dt or 0), rec.intervals)
        # x and its derivatives x_j: x_j' = A x_j + A_j x + B_j u, y_j = C x_j + C_j x + D_j u.
        whole: F64 = np.kron(np.eye(p + 1), a).astype(np.float64)
        whole[n:, :n] = da.reshape(p * n, n)
        seen: F64 = np.kron(np.eye(p + 1), c).astype(np.float64)
        seen[q:, :n] = dc.reshape(p * q, n)
        drive = np.vstack([b, db.reshape(p * n, b.shape[1])])
        through = np.vstack([d, dd.reshape(p * q, d.shape[1])])
        x0 = np.zeros(n * (p + 1))
        if start is not None:
            x0[:n] = _checked(start, n)
        driven = Inputs(list(rec.u), *words, rec.intersample, self.late, held)
        moved = (
            Inputs(list(_beyond_first(rec.u)), *words, rec.intersample, self.late, held) if held else driven
        )
        y = driven.respond((whole, drive, seen, through), x0)
        none = np.zeros((n, 0)), np.zeros((q, 0))
        free = [respond((a, none[0], c, none[1]), unit, [], *words, (), ()) for unit in np.eye(n)]
        y = y.reshape(p + 1, q, -1)
        for j, name in enumerate(self.names):
            # ∂/∂h of G(s) U e^(−hs) is −s times it: of x' = Ax + Bu that is Ax + Bu again, and D = 0.
            late = np.array([entry == name for entry in self.model.delay])
            if late.any():
                if np.any(d[:, late]):
                    raise SpecError(
                        f"crlb: the delay {name!r} is unknown and an input behind it feeds through, and a "
                        "response that jumps has no derivative to it: hold the delay, params={...}"
                    )
                y[1 + j] -= moved.respond((a, b * late, c @ a, c @ b * late), np.zeros(n))
        return Slopes(y[0], y[1:], np.array(free))


class Equations:
    """Equations with numbers; derivatives by differences of integrations on common steps."""

    accuracy = 1e-6

    def __init__(self, model: NonlinearModel) -> None:
        self.model, self.names = model, tuple(model.params)
        self.values = np.array(list(model.params.values()))
        self.outputs: tuple[str, ...] | None = model.outputs
        self.inputs: tuple[str, ...] | None = model.inputs
        self.shape = model.shape

    def slopes(self, rec: Record, start: F64 | None, held: bool = True) -> Slopes:
        model, theta = self.model, self.values
        x0 = np.zeros(len(model.states)) if start is None else _checked(start, len(model.states))
        sizes = np.concatenate([np.where(theta != 0, np.abs(theta), 1.0), np.maximum(np.abs(x0), 1e-2)])
        late = self._delays()
        steps = np.diag(np.where([name in late for name in (*self.names, *model.states)], 0.0, STEP * sizes))
        both = np.hstack([np.zeros((sizes.size, 1)), steps, -steps]) + np.concatenate([theta, x0])[:, None]
        y, _ = model.family(
            list(rec.u),
            rec.t,
            np.ascontiguousarray(both[theta.size :]),
            rec.intersample,
            params=np.ascontiguousarray(both[: theta.size]),
        )
        up, down = np.split(y[:, 1:], 2, axis=1)
        slopes = ((up - down) / (2 * STEP * sizes)[:, None]).transpose(1, 0, 2)
        for name in late:
            k = self.names.index(name)
            slopes[k] = self._to_delay(rec, x0, name, STEP * sizes[k])
        return Slopes(y[:, 0], slopes[: theta.size], slopes[theta.size :])

    def slopes_from_rest(self, rec: Record, guess: F64 | None) -> Slopes:
        """As `slopes`, from the state of rest under the inputs' first values, a function of the parameters.

        Raises
        ------
        SpecError
            Equations that change with time.
        DataError
            No state of rest is found from `guess`.
        """
        if not self.model.states:
            return self.slopes(rec, None)
        if self.model.compiled.is_driven_by_time:
            raise SpecError(
                'crlb: initial_state="rest": the equations change with time, so they rest in no state; give '
                "it, initial_state=[...]"
            )
        state, moved = self._rest(rec, guess)
        one = self.slopes(rec, state)
        return replace(one, params=one.params + np.einsum("sp,sqt->pqt", moved, one.state))

    def _rest(self, rec: Record, guess: F64 | None) -> tuple[F64, F64]:
        """The state of rest under the inputs' first values, and its derivatives, (state, parameter)."""
        from scipy.optimize import root

        theta, form, count = self.values, self.model.form, len(self.model.states)
        first = np.zeros(count) if guess is None else _checked(guess, count)
        drives = [0.0 if one.order else rec.u[one.input, 0] for one in form.drives]

        def rates(z: F64) -> F64:
            x = z[theta.size :]
            v = [*drives, *(x[past.state] for past in form.pasts)]
            return np.array(form.rates(0.0, x, v, [], z[: theta.size]), dtype=np.float64)

        with np.errstate(all="ignore"):
            found = root(lambda x: rates(np.concatenate([theta, x])), first, tol=1e-13)
            z = np.concatenate([theta, found.x])
            sizes = np.where(z != 0, np.abs(z), 1.0)
            moved = np.array([(rates(z + s) - rates(z - s)) / 2 for s in np.diag(STEP * sizes)]).T
            largest = np.abs(moved).max(axis=1)
            rests = np.all(np.isfinite(moved)) and np.all(np.abs(rates(z)) <= 1e-8 * largest / STEP)
        if rests:
            to_theta, to_state = moved[:, : theta.size], moved[:, theta.size :]
            # Of an integrator any level is a state of rest: the one found is known, and moves with nothing.
            per_step = -np.linalg.lstsq(to_state, to_theta, rcond=1e-9)[0]
            rests = np.all(np.abs(to_state @ per_step + to_theta) <= 1e-6 * largest.max())
        if not rests:
            raise DataError(
                f'crlb: initial_state="rest": no state of rest under the inputs {rec.u[:, 0].tolist()}, '
                f"searched from {first.tolist()}; give one near it, start=[...]"
            )
        return found.x, per_step * sizes[theta.size :, None] / sizes[: theta.size]

    def _delays(self) -> set[str]:
        """Parameters that stand in delays: all starts of a family share these."""
        form = self.model.form
        delays = [one.delay for one in form.drives] + [one.delay for one in form.pasts]
        return {str(symbol) for delay in delays for symbol in delay.free_symbols}

    def _to_delay(self, rec: Record, x0: F64, name: str, step: float) -> F64:
        """Derivative to a parameter in a delay; one-sided where the delay would fall below zero."""
        value = self.model.params[name]
        sides = [value + step, value - step if value >= step else value]
        found = [
            NonlinearModel(
                self.model.outputs, self.model.inputs, {**self.model.params, name: one}, self.model.compiled
            ).respond(list(rec.u), rec.t, x0, rec.intersample)
            for one in sides
        ]
        return np.asarray((found[0] - found[1]) / (sides[0] - sides[1]))


def _checked(start: F64, states: int) -> F64:
    if start.shape != (states,) or not np.all(np.isfinite(start)):
        raise SpecError(
            f"crlb: start has shape {start.shape}, the system {states} states; give that many finite numbers"
        )
    return start


Known = Transfers | States | Equations
