"""What a step of a rational fit needs: data, structure and weights; numerators for poles; new poles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from math import inf
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.cached import cached_property
from ..errors import DataError, SpecError
from ..models.layout import Layout
from .constrained import beyond, constrained, least_squares, norms
from .fractions import Fractions, Numerators, monic

__all__ = ["Point", "Problem"]


# A direction whose part beside the numerators' is smaller than this is none.
SINGULAR = 1e-10


@dataclass
class _Solved:
    """Numerators of a block of coupled paths: c = offset + slope δ + free z, and what is left of the rows."""

    paths: list[int]
    columns: F64
    offset: F64
    slope: F64
    directions: F64
    space: F64
    coefficients: F64
    residuals: F64


@dataclass
class Point:
    """Poles (without held integrators) of each denominator, delays, and the numerators best for them."""

    fractions: list[Fractions]
    values: list[C128]  # of these on the lines
    delays: F64
    numerators: list[Numerators | None]
    blocks: list[_Solved]
    response: C128

    @property
    def poles(self) -> list[C128]:
        return [own.poles for own in self.fractions]

    @cached_property
    def residuals(self) -> F64:
        return np.concatenate([block.residuals for block in self.blocks])

    @cached_property
    def cost(self) -> float:
        cost = float(self.residuals @ self.residuals)
        return cost if np.isfinite(cost) else inf


class Problem:
    """The data in units of a frequency within the band, and what a step of the iteration needs."""

    def __init__(
        self,
        omega: F64,
        response: C128,
        layout: Layout,
        weight: Any,
        dcgain: F64 | None,
    ) -> None:
        self.layout = layout
        self.omega = np.asarray(omega, dtype=np.float64)
        outputs, inputs = len(layout.outputs), len(layout.inputs)
        self.paths = [(i, j) for i in range(outputs) for j in range(inputs)]
        self.data = np.asarray(response, dtype=np.complex128).reshape(len(self.paths), -1)
        if self.data.shape[1] != self.omega.size or not np.all(np.isfinite(self.data)):
            raise DataError(
                f"fitting a frequency response: {self.omega.size} frequencies and a response of shape "
                f"{np.shape(response)}; finite gains (output, input, omega) are needed"
            )
        count = 2 * self.data.size
        if count < len(layout.param_names):
            raise DataError(
                f"fitting a frequency response: {self.omega.size} frequencies give {count} numbers for "
                f"{len(layout.param_names)} parameters; give more frequencies or a smaller structure"
            )
        positive = self.omega[self.omega > 0]
        if positive.size == 0:
            raise DataError("fitting a frequency response: no frequency is above 0")
        self.unit = float(np.sqrt(positive.min() * positive.max()))
        self.s: C128 = (1j * self.omega / self.unit).astype(np.complex128)
        self.groups = 1 if layout.common else outputs
        self._whitening(weight)
        self.targets = [self._target(block) for block in self.blocks]
        self._held_and_bounded()
        self._dcgain(dcgain)
        self._waits()

    def _whitening(self, weight: Any) -> None:
        """V with V*V = W: numbers (path, omega), or matrices (omega, path, path)."""
        lines, paths = self.omega.size, len(self.paths)
        given = np.ones(lines) if weight is None else np.asarray(weight)
        self.coupled = given.shape == (lines, paths, paths) and paths > 1
        if self.coupled:
            values, vectors = np.linalg.eigh(given)
            self.v: Any = np.sqrt(np.maximum(values, 0))[:, :, None] * vectors.conj().transpose(0, 2, 1)
        else:
            plain = np.broadcast_to(given.real.reshape(-1, lines), (paths, lines))
            self.v = np.sqrt(plain)
        if not np.all(np.isfinite(self.v)):
            raise DataError("fitting a frequency response: weights must be finite and at least 0")
        self.blocks = [list(range(paths))] if self.coupled else [[p] for p in range(paths)]

    def _held_and_bounded(self) -> None:
        """Values and bounds of coefficients in the unit of frequency, and the integrators held at 0."""
        layout = self.layout
        dens, nums = layout.places
        orders = [layout.orders[g] for g in range(self.groups)]
        power = np.zeros(len(layout.names))
        for g, order in enumerate(orders):
            power[dens[g] : dens[g] + order] = np.arange(1, order + 1)
        for i, j in self.paths:
            degree = layout.numerators[i][j]
            if degree is not None:
                own = layout.orders[i] - degree + np.arange(degree + 1)
                power[nums[i][j] : nums[i][j] + degree + 1] = own
        self.scale = self.unit**power  # coefficient = scaled × this
        self.fixed = np.array([np.nan if v is None else v for v in layout.fixed]) / self.scale
        self.low = np.array([b[0] for b in layout.bounds]) / self.scale
        self.high = np.array([b[1] for b in layout.bounds]) / self.scale
        limited = np.isfinite(self.fixed) | np.isfinite(self.low) | np.isfinite(self.high)
        self.limited: list[bool] = limited.tolist()
        self.integrators = []
        for g, order in enumerate(orders):
            count = 0
            while count < order and self.fixed[dens[g] + order - 1 - count] == 0:
                count += 1
            self.integrators.append(count)
        self.dens = [slice(dens[g], dens[g] + orders[g]) for g in range(self.groups)]
        self.orders = orders
        self.nums: list[slice | None] = []
        self.degrees = []
        for i, j in self.paths:
            degree = layout.numerators[i][j]
            self.degrees.append(degree)
            self.nums.append(None if degree is None else slice(nums[i][j], nums[i][j] + degree + 1))
        if any(self.integrators) and np.any(self.omega == 0):
            raise DataError(
                "fitting a frequency response: the structure has an integrator, whose gain at omega = 0 is "
                "infinite; leave that frequency out"
            )

    def _dcgain(self, dcgain: F64 | None) -> None:
        paths = len(self.paths)
        self.gain = np.full(paths, np.nan) if dcgain is None else np.asarray(dcgain, float).reshape(paths)
        if np.any(np.isfinite(self.gain)) and any(self.integrators):
            raise SpecError("fitting a frequency response: a structure with an integrator has no dc gain")
        self.gain[[degree is None for degree in self.degrees]] = np.nan
        self.tied = bool(np.any(np.isfinite(self.gain)))

    def _waits(self) -> None:
        """What a known delay multiplies the functions of a path by; None where it is free or zero."""
        self.waits: list[C128 | None] = []
        for i, j in self.paths:
            route = self.layout.routes[i][j]
            delay: Any = self.layout.paths[route].delay
            known = route not in self.layout.free_delays and delay != 0
            self.waits.append(np.exp(-1j * self.omega * delay) if known else None)

    def group(self, path: int) -> int:
        """Which denominator a path has."""
        return 0 if self.layout.common else self.paths[path][0]

    # Starts ----------------------------------------------------------------------------------

    def starts(self) -> list[list[C128]]:
        """Spreads of poles over the band: light pairs by ratio and by difference, real ones."""
        w = np.abs(self.s[self.s != 0])
        low, high = float(w.min()), float(w.max())
        found = []
        for kind in ("ratio", "difference", "real"):
            poles = []
            for order, integrators in zip(self.orders, self.integrators, strict=True):
                free = order - integrators
                pairs = 0 if kind == "real" else free // 2
                share = (np.arange(pairs) + 0.5) / max(pairs, 1)
                places = low + (high - low) * share if kind == "difference" else low * (high / low) ** share
                singles = free - 2 * pairs
                real = -low * (high / low) ** ((np.arange(singles) + 0.5) / max(singles, 1))
                upper = places * (-0.03 + 1j)
                poles.append(np.concatenate([upper, upper.conj(), real + 0j]))
            found.append(poles)
            if max(self.orders) - min(self.integrators) < 2:
                break
        return found

    def delay_starts(self) -> list[F64]:
        """Values of the delays that are estimated, over their bounds, one after the other."""
        layout = self.layout
        if not layout.free_delays:
            return [np.zeros(0)]
        given: Any = [layout.paths[k].delay for k in layout.free_delays]
        begin = np.array([max(d.min, 0.0) if d.start is None else d.start for d in given])
        found = [begin]
        for k, d in enumerate(given):
            least = max(d.min, 0.0)
            steps = int(np.clip((d.max - least) * self.omega.max() / 2, 4, 40))
            for value in np.linspace(least, d.max, steps + 1):
                one = begin.copy()
                one[k] = value
                found.append(one)
        return found

    # One point -------------------------------------------------------------------------------

    def late(self, values: C128, delays: F64, path: int) -> C128:
        """The functions of a path behind its delay."""
        i, j = self.paths[path]
        route, wait = self.layout.routes[i][j], self.waits[path]
        if route in self.layout.free_delays:
            wait = np.exp(-1j * self.omega * delays[self.layout.free_delays.index(route)])
        return values if wait is None else values * wait[:, None]

    def rows(self, block: list[int], path: int, columns: C128) -> F64:
        """Whitened real rows of what a path of a block adds, (row, column)."""
        if self.coupled:
            whitened = self.v[:, :, block.index(path), None] * columns[:, None, :]
            whitened = whitened.reshape(-1, columns.shape[1])
        else:
            whitened = self.v[path][:, None] * columns
        return np.concatenate([whitened.real, whitened.imag])

    def _target(self, block: list[int]) -> F64:
        """The same of a block's data, (row,)."""
        rows = [self.rows(block, p, self.data[p][:, None])[:, 0] for p in block]
        return np.asarray(np.sum(rows, axis=0))

    def point(self, poles: list[C128], delays: F64) -> Point:
        """The best numerators for some poles."""
        fractions = [Fractions(own) for own in poles]
        on_lines = [own.values(self.s) for own in fractions]
        numerators: list[Numerators | None] = []
        values: list[C128] = []
        for p, degree in enumerate(self.degrees):
            if degree is None:
                numerators.append(None)
                values.append(np.zeros((self.s.size, 0), np.complex128))
                continue
            g = self.group(p)
            if self.integrators[g]:
                basis = Numerators(np.concatenate([poles[g], np.zeros(self.integrators[g])]), degree)
            else:
                basis = Numerators(poles[g], degree, fractions[g])
            numerators.append(basis)
            known = on_lines[g] if basis.fractions is fractions[g] else None
            values.append(self.late(basis.values(self.s, known), delays, p))
        zero = np.zeros(1, np.complex128)
        at_zero = [own.values(zero)[0].real if self.tied else np.zeros(own.size) for own in fractions]
        response = np.zeros_like(self.data)
        blocks = []
        for block, target in zip(self.blocks, self.targets, strict=True):
            solved = self._numerators(block, target, numerators, values, at_zero)
            first = 0
            for p in block:
                last = first + values[p].shape[1]
                response[p] = values[p] @ solved.coefficients[first:last]
                first = last
            blocks.append(solved)
        return Point(fractions, on_lines, delays, numerators, blocks, response)

    def _numerators(
        self,
        block: list[int],
        data: F64,
        bases: list[Numerators | None],
        values: list[C128],
        at_zero: list[F64],
    ) -> _Solved:
        columns = np.concatenate([self.rows(block, p, values[p]) for p in block], axis=1)
        polynomials, fixed, bounds = self._polynomials(block, bases)
        equal = [(row, value) for row, value in zip(polynomials, fixed, strict=True) if np.isfinite(value)]
        moving = [np.zeros(sum(own.size for own in at_zero)) for _ in equal]
        starts = [0, *accumulate(own.size for own in at_zero)]
        first = 0
        for p in block:
            count = values[p].shape[1]
            basis = bases[p]
            if basis is not None and np.isfinite(self.gain[p]):
                row, slope = np.zeros(columns.shape[1]), np.zeros(starts[-1])
                row[first : first + count] = basis.values(np.zeros(1, np.complex128))[0].real
                g = self.group(p)
                slope[starts[g] : starts[g + 1]] = self.gain[p] * at_zero[g]
                equal.append((row, self.gain[p]))
                moving.append(slope)
            first += count
        while True:
            offset, slope, free = constrained(equal, columns.shape[1], moving, starts[-1])
            space, z = least_squares(columns @ free, data - columns @ offset)
            found = offset + free @ z
            over = beyond(polynomials @ found, bounds)
            if over is None:
                break
            k, value = over
            equal.append((polynomials[k], value))
            moving.append(np.zeros(starts[-1]))
            bounds[k] = (-inf, inf)
        return _Solved(block, columns, offset, slope, free, space, found, data - columns @ found)

    def _polynomials(
        self, block: list[int], bases: list[Numerators | None]
    ) -> tuple[F64, F64, list[tuple[float, float]]]:
        """Coefficients as rows over a block's unknowns, held values, bounds; only of those that have any."""
        size = sum(basis.size for p in block if (basis := bases[p]) is not None)
        rows, fixed, bounds = [], [], []
        first = 0
        for p in block:
            basis, place = bases[p], self.nums[p]
            if basis is None or place is None:
                continue
            for k in range(place.start, place.stop):
                if self.limited[k]:
                    row = np.zeros(size)
                    row[first : first + basis.size] = basis.polynomials[:, k - place.start]
                    rows.append(row)
                    fixed.append(self.fixed[k])
                    bounds.append((float(self.low[k]), float(self.high[k])))
            first += basis.size
        return np.array(rows).reshape(len(rows), size), np.array(fixed), bounds

    # Steps -----------------------------------------------------------------------------------

    def slopes(self, here: Point, gains: C128, project: bool = True) -> F64:
        """Rows over changes of the denominators (as fractions of themselves) and of free delays."""
        starts = [0, *accumulate(own.size for own in here.fractions)]
        late = self.layout.free_delays
        found = []
        for solved in here.blocks:
            total = np.zeros((solved.residuals.size, starts[-1] + len(late)))
            for p in solved.paths:
                g = self.group(p)
                part = gains[p][:, None] * here.values[g]
                total[:, starts[g] : starts[g + 1]] += self.rows(solved.paths, p, part)
                i, j = self.paths[p]
                route = self.layout.routes[i][j]
                if route in late:
                    moved = (1j * self.omega * here.response[p])[:, None]
                    at = starts[-1] + late.index(route)
                    total[:, at : at + 1] += self.rows(solved.paths, p, moved)
            if project:
                if np.any(solved.slope):
                    total[:, : starts[-1]] -= solved.columns @ solved.slope
                total -= solved.space @ (solved.space.T @ total)
            found.append(total)
        return np.concatenate(found)

    def step(self, here: Point, rows: F64, damping: float) -> tuple[tuple[list[C128], F64], float, float]:
        """New poles and delays, the fall of the cost that they promise, and their move in scaled columns."""
        size = norms(rows)
        damped = np.vstack([rows / size, np.sqrt(damping) * np.eye(size.size)]) if damping else rows / size
        target = np.concatenate([-here.residuals, np.zeros(damped.shape[0] - here.residuals.size)])
        polynomials, current, fixed, bounds = self._denominators(here)
        if (
            len(bounds) and damped.shape[0] > 4 * damped.shape[1]
        ):  # the same problem with few rows, many times
            q, damped = np.linalg.qr(damped)
            target = q.T @ target
        equal = [
            (row / size, value - now)
            for row, value, now in zip(polynomials, fixed, current, strict=True)
            if np.isfinite(value)
        ]
        while True:
            offset, _, free = constrained(equal, size.size)
            x = offset + free @ least_squares(damped @ free, target - damped @ offset)[1]
            over = beyond(current + polynomials @ (x / size), bounds)
            if over is None:
                break
            k, value = over
            equal.append((polynomials[k] / size, value - current[k]))
            bounds[k] = (-inf, inf)
        length = float(x @ x)
        x = x / size
        left = here.residuals + rows @ x
        poles = []
        first = 0
        for own in here.fractions:
            poles.append(own.zeros_with(x[first : first + own.size]) if own.size else own.poles)
            first += own.size
        return (poles, here.delays + x[first:]), here.cost - float(left @ left), length

    def is_singular(self, here: Point) -> bool:
        """Whether some changes of poles and delays change nothing that numerators could not undo."""
        size = np.linalg.norm(self.slopes(here, here.response, project=False), axis=0)
        polynomials, _, fixed, _ = self._denominators(here)
        held = [(row, 0.0) for row, value in zip(polynomials, fixed, strict=True) if np.isfinite(value)]
        free = constrained(held, size.size)[2]
        if free.shape[1] == 0:
            return False
        if np.any(size == 0):
            return True
        left = np.linalg.svd(self.slopes(here, here.response) / size @ free, compute_uv=False)
        return bool(left[-1] < SINGULAR)

    def _denominators(self, here: Point) -> tuple[F64, F64, F64, list[tuple[float, float]]]:
        """Held or bounded coefficients and delays: rows over the step, values now, held values, bounds."""
        total = sum(own.size for own in here.fractions)
        late = self.layout.free_delays
        rows, current, fixed, bounds = [], [], [], []
        first = 0
        for own, place in zip(here.fractions, self.dens, strict=True):
            for k in range(own.size):
                at = place.start + k
                if self.limited[at]:
                    row = np.zeros(total + len(late))
                    row[first : first + own.size] = own.polynomials[:, k]
                    rows.append(row)
                    current.append(monic(own.poles)[k + 1])
                    fixed.append(self.fixed[at])
                    bounds.append((float(self.low[at]), float(self.high[at])))
            first += own.size
        for k, at in enumerate(late):
            delay: Any = self.layout.paths[at].delay
            rows.append(np.eye(total + len(late))[total + k])
            current.append(here.delays[k])
            fixed.append(np.nan)
            bounds.append((max(delay.min, 0.0), delay.max))
        return (
            np.array(rows).reshape(len(rows), total + len(late)),
            np.array(current),
            np.array(fixed),
            bounds,
        )

    # The answer ------------------------------------------------------------------------------

    def theta(self, here: Point) -> F64:
        """The parameters of the structure, in the user's units."""
        values = np.where(np.isfinite(self.fixed), self.fixed, 0.0)
        for poles, where, count in zip(here.poles, self.dens, self.integrators, strict=True):
            values[where] = np.concatenate([monic(poles)[1:], np.zeros(count)])
        for solved in here.blocks:
            first = 0
            for p in solved.paths:
                basis, place = here.numerators[p], self.nums[p]
                if basis is not None and place is not None:
                    values[place] = solved.coefficients[first : first + basis.size] @ basis.polynomials
                    first += basis.size
        values = np.clip(values, self.low, self.high) * self.scale
        return np.concatenate([values[list(self.layout.free)], here.delays])

    def tangent(self, here: Point) -> tuple[F64, F64]:
        """Derivatives of residuals and of parameters over directions that all constraints allow."""
        moves = self.slopes(here, here.response, project=False)
        sizes = [solved.columns.shape[1] for solved in here.blocks]
        rows = np.zeros((moves.shape[0], sum(sizes) + moves.shape[1]))
        rows[:, sum(sizes) :] = moves
        params = np.zeros((len(self.layout.names) + here.delays.size, rows.shape[1]))
        top = left = 0
        equal: list[F64] = []
        for solved, size in zip(here.blocks, sizes, strict=True):
            rows[top : top + solved.residuals.size, left : left + size] = -solved.columns
            bind = np.zeros((size, rows.shape[1]))  # c less slope δ stays in the free directions
            bind[:, left : left + size] = np.eye(size)
            across = sum(sizes) + np.arange(solved.slope.shape[1])
            bind[:, across] = -solved.slope
            equal.append(bind - solved.directions @ (solved.directions.T @ bind))
            first = left
            for p in solved.paths:
                basis, place = here.numerators[p], self.nums[p]
                if basis is not None and place is not None:
                    params[place, first : first + basis.size] = basis.polynomials.T
                    first += basis.size
            top += solved.residuals.size
            left += size
        first = left
        for own, place in zip(here.fractions, self.dens, strict=True):
            params[place.start : place.start + own.size, first : first + own.size] = own.polynomials.T
            first += own.size
        params[len(self.layout.names) :, first:] = np.eye(here.delays.size)
        polynomials, current, fixed, bounds = self._denominators(here)
        for row, now, value, (low, high) in zip(polynomials, current, fixed, bounds, strict=True):
            if np.isfinite(value) or min(now - low, high - now) <= 1e-12 * abs(now):
                equal.append(np.concatenate([np.zeros(left), row])[None])
        _, _, free = constrained([(row, 0.0) for row in np.vstack(equal)], rows.shape[1])
        keep = [*self.layout.free, *range(len(self.layout.names), params.shape[0])]
        scale = np.concatenate([self.scale, np.ones(here.delays.size)])
        return rows @ free, (scale[:, None] * params)[keep] @ free
