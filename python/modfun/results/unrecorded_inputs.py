"""Inputs that nobody recorded: one cause of several linear equations, or what drives those without one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ..base.arrays import C128
from ..base.cached import kept
from ..base.names import listed
from ..errors import ModfunError
from .cures import DRIFT, ENOUGH, again, amplified, of_written, on_band
from .diagnosis import level_p, level_ratio
from .doubts import SURE, Doubt, noise_free
from .driven_equations import driven
from .estimates import Estimates
from .free_motion import settled_motion
from .held_numbers import contradicted_numbers
from .line_tests import correlation_of_lines
from .linear_lines import equation_lines
from .neighbours import with_offset
from .offsets import with_constant
from .scores import of_response
from .unnamed_inputs import missing_input

__all__ = ["unforced", "unrecorded_input"]

ABOVE = 3.0  # times the noise, from which residuals of an equation have a cause; of right models 0.7 to 1.3
FOLLOWED = 0.01  # p-value of neighbouring lines below which noise inside may be something else
HALF = 50.0  # per cent that a response follows: of motions that something else drives 0 to 30
TOGETHER = 0.9  # correlation of equations that have one cause: 0.95 of a rudder, 0.7 of signs
PIECE, GRID = 8, 256  # parts of a record over which power is taken, and of its samples for that
RESTS = 0.25  # median power of parts over the mean: of rudders 0.12 to 0.2, of gusts 0.33 to 1.1


@kept
def unrecorded_input(fit: Estimates) -> Doubt | None:
    """That one cause drives several equations, of which the record and the equations know nothing.

    By one-shot estimates with flat weights, which are there also where a search ends without any: without the
    rudder that moved an aircraft, weights follow noise that is not white, and the search runs off.
    """
    if fit.again is None or fit.records is None or fit.layout.rational or len(fit.outputs) < 2:
        return None
    inside = fit.options.noise == "process"
    if not (inside or fit.options.noise == "output") or (fit.usable and not _suspect(fit, inside)):
        return None
    if fit.usable and noise_free(fit) is not None:
        return None
    plain = again(fit, fit.records, fit.structure, fit.options.replace(method="ls", noise="output"))
    lines = equation_lines(plain) if plain is not None and plain.success else None
    if plain is None or lines is None:
        return None
    every = np.concatenate(lines, axis=1)
    powers = (every @ every.conj().T).real / every.shape[1]
    sizes = np.sqrt(np.diag(powers))
    large = [k for k in np.argsort(-sizes).tolist() if sizes[k] > ABOVE]
    pairs = [(powers[i, k] / sizes[i] / sizes[k], sorted((i, k))) for i, k in combinations(large, 2)]
    r, pair = max(pairs, key=lambda one: abs(one[0]), default=(0.0, []))
    if not abs(r) > TOGETHER or missing_input(fit) or contradicted_numbers(fit):
        return None
    rests = _rests(plain, [own[pair] / sizes[pair, None] for own in lines])
    if not rests and (inside or (fit.usable and driven(fit) is not None)):
        return None
    astray = rests and not fit.success  # cures next to such estimates took a minute
    if fit.usable and not astray and (cure := of_written(fit)) and cure.level_p > ENOUGH:
        return None
    if not fit.usable and fit.options.fitted_trend != "linear":
        drifted = again(fit, fit.records, fit.structure, fit.options.replace(trend="linear"))
        if drifted is not None and drifted.success and level_p(drifted) > ENOUGH:
            return Doubt(
                "The search ends without an estimate. With a drift of the outputs it settles, and the "
                f"residuals are the noise alone. First try {DRIFT}."
            )
    look = "fit.plot_response()" if fit.usable else 'mf.fit(..., method="ls").plot_response()'
    lost = "" if fit.usable else ", so that the search ends without an estimate"
    timed = " and rest most of the time, as no turbulence does" if rests else ""
    which = listed([str(k + 1) for k in pair])
    sized = listed([f"{sizes[k]:.3g}" for k in pair])
    return Doubt(
        f"The residuals of equations {which} are {sized} times what noise makes of them, and they go "
        f"together (correlation {r:.2g}){timed}{lost}: an input that is not in the record seems to act, "
        f"such as a rudder or a flap. First look when it acts, {look}, and add that input to the record."
    )


def _suspect(fit: Estimates, inside: bool) -> bool:
    """Whether there is more than noise; of noise inside, whose lines are independent, by neighbours."""
    if not inside:
        return level_p(fit) < SURE
    rows = range(len(fit.row_names))
    return any(correlation_of_lines([own[i] for own in fit.pieces])[0].p_value < FOLLOWED for i in rows)


def _rests(fit: Estimates, lines: list[C128]) -> bool:
    """Whether the cause rests most of the time, as controls do and turbulence does not."""
    found = []
    for own, (low, _) in zip(lines, fit.lines, strict=True):
        first = max(low, 1)
        whole = np.zeros((len(own), max(GRID, 2 * (first + own.shape[1])) // 2 + 1), complex)
        whole[:, first : first + own.shape[1]] = own
        power = np.sum(np.fft.irfft(whole, axis=1) ** 2, axis=0)
        count = power.size // PIECE
        every = np.cumsum(np.concatenate([[0.0], power, power[:count]]))
        found.append((every[count:] - every[:-count]) / count)
    each = np.concatenate(found)
    return bool(np.median(each) < RESTS * each.mean())


@kept
def unforced(fit: Estimates) -> Doubt | None:
    """That equations without an input follow little of a motion, which something outside them drives."""
    free = not fit.inputs and not fit.layout.rational and fit.options.noise == "output"
    if not free or fit.again is None or not fit.records or not level_p(fit) < SURE:
        return None
    if amplified(fit) or noise_free(fit) is not None or not (part := _followed(fit)) < HALF:
        return None
    if missing_input(fit) or any(p > ENOUGH for p in _left(fit)):
        return None
    y = listed(fit.outputs)
    return Doubt(
        f"The equations have no input, and their motion follows {part:.0f} % of {y} at most, with residuals "
        f"{level_ratio(fit):.3g} times the noise: a force or another input that is not in them seems to act, "
        "or a term is missing. First add what acts to the record and to the equations."
    )


def _followed(fit: Estimates) -> float:
    """How many per cent the response follows of an output, at least; 0 where it leaves all bounds."""
    try:
        found = [of_response(rec, fit.simulate(rec)[0]) for rec in fit.records or ()]
    except ModfunError:
        return 0.0
    return max(0.0, min(float(np.min(one["fit_percent"])) for one in found))


def _left(fit: Estimates) -> Iterator[float]:
    """Probabilities of the residuals where a constant, an offset, another spring or a term is added."""
    options = on_band(fit, fit.band)
    offsets = (again(fit, fit.records, own, options) for _, own, _ in with_offset(fit.structure))
    for other in (with_constant(fit), *offsets):
        if other is not None and other.success:
            yield level_p(other)
    yield settled_motion(fit)
    cure = of_written(fit)
    if cure is not None:
        yield cure.level_p
