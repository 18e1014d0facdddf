"""Powers of a signal that linear equations lack: they leave what turbulence would."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from .._core import coefficients
from ..base.arrays import C128, F64
from ..base.cached import kept
from ..equations.matrices import state_of
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.free import Free
from .cures import ENOUGH, again, convincing, likely_cure, on_band
from .diagnosis import level_p
from .doubts import SURE, Doubt, clipped, joined, noise_free
from .driven_equations import beside_turbulence
from .estimates import Estimates
from .further import Residual, simulated
from .linear_lines import Linear, linear_of, signal_lines

__all__ = ["not_linear"]

ABOVE = 3.0  # times the noise of neighbouring samples, from which noise of any colour may be something else
UNLIKELY = 1e-5  # p-value times the number of tests; of gusts, lags and drifts the least of 200 was 2e-4
PAYS = 40.0  # of BIC: the same came to 38, cubes of a tenth of the stiffness to 110
SAME = 1e-6  # columns closer to each other are the same
POWERS = (2, 3)  # both: about another zero a cube is a square, too


class _Powers(NamedTuple):
    """The equation and the channel whose powers explain most; p-value, allowing for the number of tests."""

    equation: int
    channel: str
    p_value: float


@kept
def not_linear(fit: Estimates) -> Doubt | None:
    """That powers of a signal explain what linear equations leave, and what no linear change of them does.

    Residuals have the spectrum that turbulence leaves. Yet they follow powers of the simulated motion, which
    knows of the inputs alone, and with powers of the measured one less noise is left for the equations.
    """
    base = _with_noise_inside(fit)
    found = _likeliest(base) if base is not None else None
    if base is None or found is None or not found.p_value < UNLIKELY or joined(fit) or clipped(fit):
        return None
    other = _with_powers(base, found)
    if other is None or not other.bic < base.bic - PAYS:
        return None
    if _cured(fit):
        return None
    x, state = found.channel, _states(base).get(found.equation)
    of = f"equation {found.equation + 1}" if state is None else f"{state}'"
    return Doubt(
        f"The residuals of {of} follow {x}**2 and {x}**3 (p = {found.p_value:.1g}): the system is not linear "
        "over this range, and estimates are of a line through its bend. First try an mf.Equation with terms "
        f"in {x}**2 and {x}**3 there, {x} from its trim, or smaller manoeuvres. With noise in each equation "
        f"these terms lower BIC from {base.bic:.4g} to {other.bic:.4g}."
    )


def _with_noise_inside(fit: Estimates) -> Estimates | None:
    """The fit with white noise in each equation, where there may be more than noise of the samples."""
    records, noise = fit.records or (), fit.options.noise
    even = all(rec.dt is not None and rec.mask is None and rec.sigma is None for rec in records)
    if fit.layout.rational or fit.again is None or not records or not even or fit.with_past:
        return None
    if noise == "process":
        return fit if fit.process_levels is not None else None
    if linear_of(fit) is None:
        return None  # before cures, which take long
    if noise == "output":  # of one equation all terms are tried, and the one that is missing is named
        beyond = len(fit.outputs) > 1 and level_p(fit) < SURE and noise_free(fit) is None and not _cured(fit)
    else:
        beyond = noise == "coloured" and _above(fit)
    return beside_turbulence(fit) if beyond else None


def _cured(fit: Estimates) -> bool:
    """Whether a linear change leaves the noise alone."""
    cure = likely_cure(fit)
    return cure is not None and (cure.level_p > ENOUGH or convincing(fit, cure))


def _above(fit: Estimates) -> bool:
    """Whether noise is far above what neighbouring samples have by themselves."""
    fast = np.mean([np.mean(np.diff(rec.y, 4) ** 2, axis=1) for rec in fit.records or ()], axis=0) / 70
    return bool(np.any(fit.noise_cov.diagonal() > ABOVE**2 * fast))


def _likeliest(fit: Estimates) -> _Powers | None:
    """F tests of powers of each channel in each equation, beside all channels and their derivatives.

    Lines are weighted by the levels of both kinds of noise, and these by a slope or by noise that falls off.
    Channels are those of a simulation: measured ones hold what noise and a gust do.
    """
    model = linear_of(fit)
    motions = [simulated(fit, k) for k in range(len(fit.lines))] if model else []
    if model is None or any(y is None for y in motions):
        return None
    parts = [_Part.of(fit, model, k, y) for k, y in enumerate(motions) if y is not None]
    ends = np.cumsum([0, *(2 * part.m.size for part in parts)])
    x = np.concatenate([np.tile(np.log(part.m + 1.0), 2) for part in parts])
    falling = np.exp(-2 * x)
    rows = _states(fit) if isinstance(fit.structure, StateSpace) else range(len(fit.outputs))
    tests = list[_Powers]()
    for row in rows:
        e = np.concatenate([_real(part.e[row] / part.noise[row]) for part in parts])
        basis = _basis(np.concatenate([*_beside(parts, row, ends)]))
        lines = Residual(row, basis.T, e, x, falling / falling.mean(), ends, basis, SURE)
        for j, name in enumerate((*fit.outputs, *fit.inputs)):
            one = lines.tested("power", name, [part.powers[j] / part.noise[row] for part in parts])
            if one.p_value <= 1:  # nan of what is none beside the others
                tests.append(_Powers(row, name, one.p_value))
    best = min(tests, key=lambda one: one.p_value, default=None)
    return best and best._replace(p_value=min(1.0, best.p_value * len(tests)))


class _Part(NamedTuple):
    """Lines of one record: residuals of equations, their noise, channels, powers of these, and ends."""

    m: F64
    e: C128
    noise: F64
    linear: C128  # channels and their derivatives, (row, line)
    powers: C128  # (channel, power, line)
    ends: C128

    @classmethod
    def of(cls, fit: Estimates, model: Linear, k: int, y: F64) -> _Part:
        assert fit.process_levels is not None
        rec: Any = (fit.records or ())[k]
        v, p, _, s, shapes = signal_lines(fit, model, k, exact=False)
        e = model.weights[0] @ (s[:, None] * v).reshape(-1, v.shape[1])
        levels, count, orders = fit.process_levels[0], len(fit.outputs), max(fit.layout.orders) + 1
        noise = np.einsum("eol,o->el", np.abs(p) ** 2, levels[:count]) + levels[count:, None] / rec.dt
        rows = np.concatenate([y, rec.u[:, rec.intervals - fit.intervals[k] :]])
        rows = rows - rows.mean(axis=1)[:, None]
        rows /= np.maximum(np.abs(rows).max(axis=1), 1e-300)[:, None]
        every = np.ascontiguousarray(np.concatenate([rows, *(rows**power for power in POWERS)]))
        m = np.arange(max(fit.lines[k][0], 1), fit.lines[k][1] + 1, dtype=np.float64)
        kinds = [fit.options.rule] * len(every)
        lines = coefficients(every, int(m[-1]), kinds, [0.0] * len(every), 0, None)[:, int(m[0]) :]
        own, raised = lines[: len(rows)], lines[len(rows) :].reshape(len(POWERS), len(rows), -1)
        linear = np.concatenate([own * (1j * m / m[-1]) ** order for order in range(orders + 1)])
        return cls(m, e, np.sqrt(noise), linear, raised.swapaxes(0, 1), shapes[:orders])


def _beside(parts: list[_Part], row: int, ends: Any) -> list[F64]:
    """Columns of the channels over all records, and those of the ends of each."""
    found = [np.concatenate([_real(part.linear / part.noise[row]) for part in parts], axis=1)]
    for part, (first, last) in zip(parts, pairwise(ends), strict=True):
        own = np.zeros((len(part.ends), ends[-1]))
        own[:, first:last] = _real(part.ends / part.noise[row])
        found.append(own)
    return found


def _basis(rows: F64) -> F64:
    """Orthonormal columns that span rows, some of which are made of others."""
    size = np.linalg.norm(rows, axis=1)
    left, s, _ = np.linalg.svd((rows[size > 0] / size[size > 0, None]).T, full_matrices=False)
    return np.asarray(left[:, s > SAME])


def _real(rows: Any) -> F64:
    return np.concatenate([rows.real, rows.imag], axis=-1)


def _states(fit: Estimates) -> dict[int, str]:
    """Of state spaces: the measured states whose rates stand in the equations, by these."""
    model, lines = fit.structure, linear_of(fit)
    if not isinstance(model, StateSpace) or lines is None:
        return {}
    rates = np.abs(lines.weights[0].reshape(len(fit.outputs), -1, len(lines.of))[:, 1])
    found = dict[int, str]()
    for y, (c, d) in enumerate(zip(model.C, model.D, strict=True)):
        state = state_of(c, d)
        if state is not None and y in lines.of:
            found.setdefault(int(np.argmax(rates[:, lines.of.index(y)])), model.states[state])
    return found


def _with_powers(fit: Estimates, found: _Powers) -> Estimates | None:
    """The fit with powers of the measured channel as further inputs of the equation."""
    x, records, model = found.channel, fit.records or (), fit.structure
    names = [f"{x}_to_{power}" for power in POWERS]
    every = np.concatenate([rec[x] for rec in records])
    centre, size = float(every.mean()), float(np.ptp(every)) or 1.0
    inputs, free = [*fit.inputs, *names], [f"times_{name}" for name in names]
    more = []
    for rec in records:
        own: Any = {
            name: ((rec[x] - centre) / size) ** power for name, power in zip(names, POWERS, strict=True)
        }
        more.append(rec.assign(**own).select(outputs=fit.outputs, inputs=inputs))
    try:
        if isinstance(model, StateSpace):
            at, nothing = model.states.index(_states(fit)[found.equation]), [0] * len(names)
            changes: dict[str, Any] = {
                "B": [[*own, *(free if i == at else nothing)] for i, own in enumerate(model.B)],
                "D": [[*own, *nothing] for own in model.D],
                "delay": [*model.delay, *nothing],
            }
        else:
            terms = "".join(f" + {own}*{name}" for own, name in zip(free, names, strict=True))
            texts = enumerate(model.texts)
            changes = {"text": [text + terms * (k == found.equation) for k, text in texts]}
        params = {**dict(model.params), **{name: Free() for name in free}}
        structure = model._like(**changes, inputs=inputs, params=params)
    except ModfunError:  # names that are taken, say
        return None
    return again(fit, tuple(more), structure, on_band(fit, fit.band))
