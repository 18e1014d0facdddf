"""Dry friction: motion that slows down more than in proportion to its rate leaves what turbulence would."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf, log, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.cached import kept
from ..base.least_squares import damped_step, levenberg_marquardt
from ..base.words import TRENDS
from ..equations.equation import Equation
from ..equations.nonlinear import model_of
from ..errors import ModfunError
from ..models.free import Free
from ..models.transfer_function import TransferFunction
from ..records.functions import drives
from ..records.record import Record
from .cures import CLOSE, ENOUGH, again, likely_cure, with_drift
from .diagnosis import high_band_df
from .doubts import Doubt, noise_free
from .estimates import Estimates
from .free_motion import settled_motion
from .lags import unused
from .misfit import suspicious
from .next_structures import best_cure

__all__ = ["dry_friction"]

WIDTH = 0.005  # of the largest rate: within it friction turns, smoothly, so that slopes of the response tell
BOTH = 0.1  # of the largest rate: that of the other way, at least
CLEAR = 6.0  # standard errors of friction from zero
LESS = 4.0  # times less power: what leaves more than the noise is named where it explains so much
SMALL = 0.01  # of what moves: a size of unknowns that may be zero
STEP, RTOL = 1e-6, 1e-8  # of an unknown's size: the difference that stands for a slope; of integrations
ROUNDS, SETTLED = 30, 1e-7


class _Words(NamedTuple):
    """An equation with friction, where a search of it begins, and the parameter that friction is."""

    structure: Equation
    start: dict[str, float]
    force: str


class _Motion(NamedTuple):
    """A response with friction: parameters with errors, mean squares that it and one without it leave."""

    params: dict[str, float]
    errors: dict[str, float]
    square: float
    without: float
    left: F64  # of the samples
    bic: float


@dataclass(frozen=True, eq=False)
class _Point:
    """Unknowns, what samples differ from the response by, and slopes of it."""

    x: F64
    residual: F64
    jacobian: F64

    @property
    def cost(self) -> float:
        return float(self.residual @ self.residual)


@kept
def dry_friction(fit: Estimates) -> Doubt | None:
    """That dry friction explains what a linear fit leaves, also where that is taken for noise inside.

    What friction slows down decays faster the smaller it is. A line through that leaves what something that
    drives the system would, and with noise="process" nothing is left to see, though damping may be 27
    standard errors off. The response tells: with friction it leaves the noise of the samples, or a fraction
    of what it leaves without. Friction below zero is none: damping that grows with the amplitude, as drag
    does, looks so.
    """
    base = _in_white_noise(fit)
    if base is None or noise_free(base) or not suspicious(base):
        return None
    try:
        with np.errstate(all="ignore"):
            words = _words(base)
            found = _Search(base, words).found() if words else None
    except (ModfunError, np.linalg.LinAlgError):  # names that equations do not take, or no response
        return None
    if words is None or found is None or not found.params[words.force] > CLEAR * found.errors[words.force]:
        return None
    explained = _level_p(base, found) > ENOUGH or found.without > LESS * found.square
    return Doubt(_told(fit, base, words, found)) if explained and not _otherwise(base, found) else None


def _in_white_noise(fit: Estimates) -> Estimates | None:
    """The fit in white noise of the samples, of one output on even samples; None of others."""
    records = fit.records or ()
    alone = len(fit.outputs) == len(fit.row_names) == 1 and fit.layout.orders[0] in (1, 2)
    even = all([rec.dt is not None and rec.mask is None and rec.sigma is None for rec in records])
    if not (alone and even and records) or fit.again is None or fit.with_past or fit.options.reference:
        return None
    if fit.options.noise == "process":
        return again(fit, records, fit.structure, fit.options.replace(noise="output"))
    return fit if fit.options.noise == "output" and fit.usable else None


def _words(fit: Estimates) -> _Words | None:
    """The linear equation that was fitted with friction beside its highest derivative; None of others.

    A sign would jump, and differences of responses do not see how the instants of jumps move.
    """
    text, y, n = _text(fit), fit.outputs[0], fit.layout.orders[0]
    sides = text.split("=") if text else []
    own = [k for k, side in enumerate(sides) if re.search(_derivative(y, n), side)]
    if text is None or len(sides) != 2 or len(own) != 1:
        return None
    held = {} if fit.layout.rational else {k: v for k, v in fit.structure.params if not isinstance(v, Free)}
    plain = Equation(text, outputs=y, inputs=fit.inputs)
    force, offset, rate = (unused(name, plain) for name in ("friction", "offset", f"{y}_rate"))
    moves = [_motion(rec, row, n)[-1] for rec, row in _responses(fit)]
    if not any([min(-row.min(), row.max()) > BOTH * np.max(np.abs(row)) for row in moves]):
        return None  # a motion one way has no friction that is told from a constant rate
    width = f"{WIDTH * max([float(np.max(np.abs(row))) for row in moves]):.1g}"
    start = dict(zip(fit.param_names, fit.params.tolist(), strict=True))
    sides[own[0]] = f"{sides[own[0]].rstrip()} + {force}*tanh({rate if n == 2 else y}/{width})"
    sides = [side.strip() for side in sides]
    if fit.trend:  # of a transfer function, beside its response
        right = sides[1 - own[0]]
        sides[1 - own[0]] = offset if right == "0" else f"{right} + {offset}"
        beside = fit.simulate((fit.records or ())[0])[1].trend
        start[offset] = float(fit.polynomials(0)[0][-1] * beside[0])
    texts = [" = ".join(sides)]
    if n == 2:
        moved = re.sub(_derivative(y, 2), f"{rate}'", texts[0])
        texts = [f"{y}' = {rate}", re.sub(_derivative(y, 1), rate, moved)]
    structure = Equation(texts, outputs=y, inputs=fit.inputs, params=held)
    return _Words(structure, start | {force: 0.0}, force)


def _derivative(name: str, order: int) -> str:
    """A pattern of a derivative."""
    return rf"(?<![\w.]){re.escape(name)}{order * chr(39)}(?![\w'])"


def _text(fit: Estimates) -> str | None:
    """The linear equation of a fit; of transfer functions one without zeros or delays."""
    model, layout = fit.structure, fit.layout
    if isinstance(model, Equation) and len(model.texts) == 1:
        linear = model.compiled(fit.outputs, fit.inputs).is_linear and not fit.trend
        return (
            model.texts[0] if linear and not (model.hidden or model.varying or layout.free_delays) else None
        )
    if not isinstance(model, TransferFunction) or any([path.delay != 0 for path in layout.paths]):
        return None
    if any([degree != 0 for degree in layout.numerators[0]]):
        return None
    y, n = layout.outputs[0], layout.orders[0]
    factors = [
        name if value is None else f"{value:.6g}"
        for name, value in zip(layout.names, layout.fixed, strict=True)
    ]
    left = [f"{own}*{y}{(n - k) * chr(39)}" for k, own in enumerate(factors[:n], 1)]
    right = [f"{own}*{u}" for own, u in zip(factors[n:], layout.inputs, strict=True)]
    return f"{y}{n * chr(39)} + {' + '.join(left)} = {' + '.join(right) or '0'}"


def _responses(fit: Estimates) -> list[tuple[Record, F64]]:
    """Records with the output as the linear fit simulates it."""
    return [(rec, fit.simulate(rec)[0][0]) for rec in fit.records or ()]


def _motion(rec: Record, row: F64, count: int) -> list[F64]:
    """A response and its derivatives, so many rows, about."""
    found = [row]
    while len(found) < count:
        found.append(np.gradient(found[-1], rec.dt or 1.0))
    return found


class _Search:
    """Least squares of the response with friction, over parameters and the initial states of records."""

    def __init__(self, fit: Estimates, words: _Words) -> None:
        self.structure, self.records, self.words = words.structure, fit.records or (), words
        self.compiled = self.structure.simulated(fit.outputs, fit.inputs)
        self.names, n = self.compiled.parameters, fit.layout.orders[0]
        states, sizes = list[float](), list[float]()
        for rec, row in _responses(fit):
            motion = _motion(rec, row, n + 1)
            states += [float(own[0]) for own in motion[:n]]
            sizes += [SMALL * float(np.ptp(own)) for own in motion[:n]]
            push = SMALL * float(np.max(np.abs(motion[n])))
        self.x = np.array([*(words.start[name] for name in self.names), *states])
        forces = [push if name not in fit.param_names else 0.0 for name in self.names]
        self.sizes = np.maximum(np.array([*forces, *sizes]), SMALL * np.abs(self.x))

    def found(self) -> _Motion | None:
        """The response with friction beside that without; None where either search does not end."""
        force = self.names.index(self.words.force)
        without = self._least(self.x, np.arange(self.x.size) != force)
        here = self._least(without.x, np.ones(self.x.size, bool)) if without else None
        if here is None or without is None:
            return None
        bic = _of_cost(here.cost, here.residual.size, here.x.size)
        size, freedom = np.linalg.norm(here.jacobian, axis=0), here.residual.size - here.x.size
        scaled = here.jacobian / size
        errors = np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled)) * here.cost / freedom) / size
        params, spread = (dict(zip(self.names, row.tolist(), strict=False)) for row in (here.x, errors))
        return _Motion(params, spread, here.cost / freedom, without.cost / freedom, here.residual, bic)

    def _least(self, x: F64, free: NDArray[np.bool_]) -> _Point | None:
        """Where steps of the free unknowns end."""
        here = self._point(x)
        if here is None:
            return None
        found, _, ended = levenberg_marquardt(
            here,
            lambda at: at.jacobian * free,
            damped_step,
            lambda at, move: self._point(at.x + move),
            enough=0.0,
            tol=SETTLED,
            maxiter=ROUNDS,
        )
        return found if ended == "settled" else None

    def _point(self, x: F64) -> _Point | None:
        """Unknowns with what they leave; None where they have no response."""
        p, residual, rows = len(self.names), list[F64](), list[F64]()
        steps, place = STEP * np.maximum(np.abs(x), self.sizes), p
        model = model_of(self.compiled, x[:p], self.structure)
        n = len(model.states)
        for rec in self.records:
            at = np.append(np.arange(p), np.arange(place, place + n))
            place += n
            moved = x[at][:, None] + np.hstack([np.zeros((at.size, 1)), np.diag(steps[at])])
            try:
                y, _ = model.family(
                    drives(rec, 0.0), rec.t, np.ascontiguousarray(moved[p:]), rec.intersample,
                    RTOL, None, np.ascontiguousarray(moved[:p]),
                )  # fmt: skip
            except ModfunError:
                return None
            slopes = np.zeros((rec.t.size, x.size))
            slopes[:, at] = ((y[0, 1:] - y[0, 0]) / steps[at][:, None]).T
            residual.append(rec.y[0] - y[0, 0])
            rows.append(slopes)
        found = _Point(x, np.concatenate(residual), np.concatenate(rows))
        return found if np.isfinite(found.cost + np.sum(found.jacobian)) else None


def _level_p(fit: Estimates, found: _Motion) -> float:
    """Probability of residuals as large beside the noise of the high band, on the frequencies of the fit.

    Over all samples what a gust leaves there would be lost in the noise of the others.
    """
    from scipy.special import fdtrc

    power, lines, ends = 0.0, 0, np.cumsum([rec.t.size for rec in fit.records or ()])[:-1]
    for rec, left in zip(fit.records or (), np.split(found.left, ends), strict=True):
        top = int(fit.band[1] * (rec.dt or 0.0) * left.size / (2 * pi))
        power += 2 * float(np.sum(np.abs(np.fft.rfft(left)[1 : top + 1]) ** 2)) / left.size
        lines += top
    freedom, seen = 2 * lines - len(found.params), float(np.mean(fit.high_band_levels**2))
    return float(fdtrc(freedom, high_band_df(fit), power / freedom / seen)) if seen > 0 < freedom else 0.0


def _otherwise(fit: Estimates, found: _Motion) -> bool:
    """Whether another structure, or one that is not linear otherwise, leaves the noise alone.

    Two more poles, close to those that are there, do in a short record: BIC of the samples then decides.
    """
    if fit.layout.rational:
        cures = [best_cure(fit, 0, name) for name in fit.inputs or (None,)]
    else:
        cures = [likely_cure(fit)]
    cures += [with_drift(fit)] if fit.trend == "constant" else []
    settled = [cure for cure in cures if cure is not None and cure.level_p > ENOUGH]
    return settled_motion(fit) > ENOUGH or any([_bic(cure.fit) < found.bic + CLOSE for cure in settled])


def _bic(fit: Estimates | None) -> float:
    """BIC of the samples of a linear fit."""
    if fit is None:
        return -inf
    left = np.concatenate([rec.y[0] - row for rec, row in _responses(fit)])
    own = fit.layout.orders[0] + TRENDS.index(fit.trend)
    return _of_cost(float(left @ left), left.size, fit.params.size + own * len(fit.records or ()))


def _of_cost(cost: float, rows: int, unknowns: int) -> float:
    return rows * log(cost / rows) + unknowns * log(rows)


def _told(fit: Estimates, base: Estimates, words: _Words, found: _Motion) -> str:
    """What friction explains, and how to go on."""
    y, model = fit.outputs[0], words.structure
    far = [abs(found.params[name] - own) for name, own in zip(fit.param_names, fit.params, strict=True)]
    at = int(np.argmax(np.array(far) / np.where(fit.bse > 0, fit.bse, np.inf)))
    name, force = fit.param_names[at], words.force
    start = {own: float(f"{value:.5g}") for own, value in found.params.items()}
    given = f", inputs={list(fit.inputs)}" if fit.inputs else ""
    given += f", params={dict(model.params)}" if model.params else ""
    texts = f"[{', '.join([chr(34) + text + chr(34) for text in model.texts])}]"
    code = f"mf.rivals.output_error(mf.Equation({texts}, outputs={y!r}{given}), start={start})"
    records = "rec" if len(fit.records or ()) == 1 else "records"
    return (
        f"Dry friction seems to slow {y} down: with {force} = {found.params[force]:.3g} ± "
        f"{found.errors[force]:.2g} the response leaves {sqrt(found.square):.3g} of the samples, without it "
        f"{sqrt(found.without):.3g}; the noise of the unused high band is {base.high_band_levels[0]:.3g}. "
        'What a linear equation leaves looks like noise that drives the system, but with noise="process" '
        f"estimates are wrong, too. First fit the response, {code}({records}): {name} becomes "
        f"{found.params[name]:.4g} ± {found.errors[name]:.2g} (was {fit.params[at]:.4g} ± "
        f"{fit.spread[at]:.2g})."
    )
