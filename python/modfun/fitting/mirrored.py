"""Unstable estimates with free delays: a mirrored pole and a shorter delay make nearly the same response.

(p − s)/(p + s) is about exp(−2s/p) up to the frequency p, and all-pass. A step or a slow sweep tells an
unstable pole p with the delay τ hardly from a stable one −p with the delay τ − 2/p. A plant that a loop holds
has a delay below 1/p, and no such twin.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64
from ..models.free import Free
from ..models.layout import Layout
from ..results.diagnosis import growth
from ..results.estimates import Estimates
from ..results.stability import deviance
from ..systems.polynomials import roots

__all__ = ["SURELY", "as_likely", "mirrored"]

SURELY = 10.0  # −2 log likelihood by which a record has to prefer the unstable model


def mirrored(fit: Estimates) -> F64 | None:
    """Parameters with unstable poles mirrored and delays as much shorter; None where there are none."""
    layout: Layout = fit.layout
    if not (layout.free_delays and fit.usable) or fit.process_levels is not None:
        return None
    theta, positions = np.array(fit.params, float), layout.positions
    (dens, nums), shifts = layout.places, dict[int, float]()
    for i, order in enumerate(layout.orders):
        den, numerators = layout.polynomials(fit.params, i)
        poles = roots(den)
        unstable = poles[poles.real > 0]
        shift = float(np.sum(2 * np.real(1 / unstable)))
        sign = (-1.0) ** np.count_nonzero(unstable.imag == 0)  # the gain at low frequencies stays
        stable = np.poly(np.where(poles.real > 0, -poles.conj(), poles)).real
        moved = [*zip(range(dens[i], dens[i] + order), stable[1:], strict=True)]
        for at, degree, numerator in zip(nums[i], layout.numerators[i], numerators, strict=True):
            if degree is not None:
                moved += zip(range(at, at + degree + 1), sign * numerator, strict=True)
        for place, value in moved:
            position = positions[place]
            if position is not None:
                theta[position] = value
            elif unstable.size:
                return None
        for path, degree in zip(layout.routes[i], layout.numerators[i], strict=True):
            if degree is not None and shifts.setdefault(path, shift) != shift:
                return None
    for path, shift in shifts.items():
        delay = layout.paths[path].delay
        if not shift:
            continue
        if not isinstance(delay, Free):
            return None
        at = len(layout.free) + layout.free_delays.index(path)
        least = max(delay.min, 0.0)
        if theta[at] - shift < least - shift / 2:
            return None
        theta[at] = max(theta[at] - shift, least)
    return theta if any(shifts.values()) else None


def as_likely(fit: Estimates, twin: Estimates) -> bool:
    """Whether a stable twin on the same lines is to be taken for an unstable estimate."""
    return twin.success and growth(twin) < 0 and deviance(twin) - deviance(fit) < SURELY
