"""Noise of a fit that is larger than the signal, or covers what the model lacks."""

from __future__ import annotations

import numpy as np

from ..base.cached import kept
from .cures import ENOUGH, again, of_written
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .estimates import Estimates

__all__ = ["loud_noise"]


@kept
def loud_noise(fit: Estimates) -> Doubt | None:
    """That the noise which a fit states exceeds the range of an output, or that it covers a missing term.

    Weights by the spectrum of any residuals leave white lines and nothing to test, whatever the model lacks.
    """
    stated = fit.options.noise in ("output", "coloured", "process") and fit.options.method in ("ml", "awls")
    if not (stated and fit.records):
        return None
    ranges = np.max([np.ptp(rec.y, axis=1) for rec in fit.records], axis=0)
    levels = np.broadcast_to(fit.sigma, ranges.shape)
    ratio = levels / np.where(ranges > 0, ranges, np.inf)
    at = int(np.argmax(ratio))
    loud = ratio[at] > 1
    term = _covered(fit) if fit.options.noise != "output" and (loud or len(fit.row_names) == 1) else ""
    if not (loud or term):
        return None
    y, text = fit.outputs[at], ""
    if loud:
        text = (
            f"The noise that the fit states, with a standard deviation of {levels[at]:.4g} on {y}, is "
            f"{ratio[at]:.3g} times the range of {y}: the model explains next to nothing beside it. "
        )
        term = term or (
            "A term or an input is missing, or a disturbance drifts. First look when it does, "
            "fit.plot_response(), or take a record in which the inputs move the outputs more."
        )
    return Doubt(text + term, sure=False)


def _covered(fit: Estimates) -> str:
    """A term that leaves only white noise on the outputs, in words; "" without one."""
    if fit.layout.rational or fit.again is None:
        return ""
    options = fit.options.replace(noise="output", band=None, harmonics=None)
    white = again(fit, fit.records, fit.structure, options)
    if white is None or not level_p(white) < SURE:
        return ""
    cure = of_written(white)
    if cure is None or not cure.level_p > ENOUGH:
        return ""
    return (
        "The noise of the fit covers a part of the response that is missing. First try "
        f'{cure.words} and noise="output": what is left is then white noise on the outputs.'
    )
