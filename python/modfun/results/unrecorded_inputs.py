"""Inputs that nobody recorded: one cause of the residuals of several linear equations."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ..base.cached import kept
from ..base.names import listed
from .cures import ENOUGH, again, of_written
from .diagnosis import level_p
from .doubts import SURE, Doubt, noise_free
from .driven_equations import driven
from .estimates import Estimates
from .held_numbers import contradicted_numbers
from .linear_lines import equation_lines
from .unnamed_inputs import missing_input

__all__ = ["unrecorded_input"]

ABOVE = 3.0  # times the noise, from which residuals of an equation have a cause; of right models 0.7 to 1.3
TOGETHER = 0.9  # correlation of equations that have one cause: 0.95 of a rudder, 0.7 of signs


@kept
def unrecorded_input(fit: Estimates) -> Doubt | None:
    """That one cause drives several equations, of which the record and the equations know nothing.

    By one-shot estimates with flat weights, which are there also where a search ends without any: without the
    rudder that moved an aircraft, weights follow noise that is not white, and the search runs off.
    """
    if fit.again is None or fit.records is None or fit.layout.rational or len(fit.outputs) < 2:
        return None
    if fit.options.noise != "output" or (fit.usable and not level_p(fit) < SURE):
        return None
    if fit.usable and noise_free(fit) is not None:
        return None
    plain = again(fit, fit.records, fit.structure, fit.options.replace(method="ls"))
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
    if fit.usable and (driven(fit) is not None or ((cure := of_written(fit)) and cure.level_p > ENOUGH)):
        return None
    look = "fit.plot_response()" if fit.usable else 'mf.fit(..., method="ls").plot_response()'
    lost = "" if fit.usable else ", so that the search ends without an estimate"
    which = listed([str(k + 1) for k in pair])
    sized = listed([f"{sizes[k]:.3g}" for k in pair])
    return Doubt(
        f"The residuals of equations {which} are {sized} times what noise makes of them, and they go "
        f"together (correlation {r:.2g}){lost}: an input that is not in the record seems to act, such as a "
        f"rudder or a flap. First look when it acts, {look}, and add that input to the record."
    )
