"""Modes that a structure lacks, told from what looks like them: powers, a hum, noise that drives a mode."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .cures import CLOSE, Cure, again, on_band
from .diagnosis import diagnose, poles_of
from .doubts import SURE
from .estimates import Estimates
from .further import Explained
from .next_structures import best_cure, settles
from .origin import hum, in_process_noise, on_wide_band, origin, wide_band

__all__ = ["UNSPOKEN", "like_gusts", "linear_instead", "missing_mode", "tone_left"]

UNSPOKEN = 20.0  # of BIC: what leaves no doubt though no test has shown it; uneven noise made 11
SLOWEST = 2.5  # periods in a record, of a tone: fewer are those of slow noise
DECAYS = 1.0  # of log amplitude over the shortest record: what all modes lose, so that none follows a hum


def tone_left(fit: Estimates, *, wide: bool = False) -> tuple[int, float, float] | None:
    """Output, frequency and part of the power of the tone that most residuals are; see `hum`.

    None where a mode that decays explains them. `wide`: also on a wide band where a fit has few lines, of
    which none stands out.
    """
    found = hum(fit)
    if found is None and wide:
        other = on_wide_band(fit)
        found = hum(other) if other is not None else None
    if found is None or not found[1] > SLOWEST * min(fit.omega0):  # one period is a load that changes once
        return None
    cures = _settling(fit, found[0])
    return None if any(_decays(cure) for cure in cures) else found


def missing_mode(fit: Estimates, output: int) -> Cure | None:
    """The structure that brings residuals down to the noise; None where noise or a tone does it as well."""
    cures = [
        cure
        for cure in _settling(fit, output)
        if not (cure.words.startswith("two more") and (tone_left(fit, wide=True) or like_gusts(fit, cure)))
    ]
    return min(cures, key=lambda cure: cure.after, default=None)


def linear_instead(fit: Estimates, one: Explained) -> Cure | None:
    """The linear structure that explains what powers or a change do, and leaves nothing to these."""
    channels = fit.inputs if len(fit.inputs) == 1 else (None,)  # of several only poles: delays are searches
    every = _cures(fit, one.output, channels)
    cures = [cure for cure in every if cure.before - cure.after > one.bic - CLOSE]
    best = min(cures, key=lambda cure: cure.after, default=None)
    if best is None or best.fit is None:
        return None
    left = [other.p_value for other in diagnose(best.fit, SURE).further if other.what == one.what]
    return best if min(left, default=1.0) > SURE else None


def like_gusts(fit: Estimates, cure: Cure | None = None) -> bool:
    """Whether noise that drives the system may have made the residuals; not if a cure explains far more.

    Two more poles follow what drives a light mode. In 24 records of one in gusts, noise="process" had a BIC
    up to 570 lower than these, or at most 11 higher. In 24 of two modes it was 22 to 107 higher.
    """
    if origin(fit) not in ("process", "either"):
        return False
    if cure is None or cure.fit is None:
        return True
    driven = in_process_noise(fit)
    other = again(fit, fit.records, cure.fit.structure, on_band(fit, wide_band(fit)))
    return driven is None or other is None or not other.bic < driven.bic - UNSPOKEN


def _cures(fit: Estimates, output: int, channels: Sequence[str | None]) -> list[Cure]:
    """Of each input the structure next to the fitted one that pays most; of None that with more poles."""
    cures = [best_cure(fit, output, channel) for channel in channels]
    return [cure for cure in cures if cure is not None]


def _settling(fit: Estimates, output: int) -> list[Cure]:
    """Those that leave no more than noise."""
    cures = _cures(fit, output, fit.inputs or (None,))
    return [cure for cure in cures if settles(cure) and cure.before - cure.after > UNSPOKEN]


def _decays(cure: Cure) -> bool:
    """Whether all modes of a structure decay within the records, as a mode does which follows a hum not."""
    fit = cure.fit
    if fit is None or fit.records is None:
        return False
    slowest = float(np.max(poles_of(fit).real, initial=-np.inf))
    return -slowest * min(rec.duration for rec in fit.records) > DECAYS
