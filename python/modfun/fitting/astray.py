"""Noise levels that ran away on few lines, which choose a default band: learnt anew on all of its lines."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, log
from typing import Any

import numpy as np

__all__ = ["settled_levels"]

FAR = 0.05  # between costs and degrees of freedom, relative: the two agree where levels have settled
BEYOND = 1e-9  # of the band's upper edge, on which a line lies


def settled_levels(
    found: dict[str, Any], on_band: Callable[[tuple[float, float]], dict[str, Any]]
) -> dict[str, Any]:
    """The core's answer, or that on the same band, as a given one, where its levels come to rest.

    Levels for a default band begin as few lines show them. Where turbulence drives the equations, parameters
    may follow these levels upwards without end: lateral doublets left residuals of 10,000 degrees. On a given
    band levels begin as the high band shows them.
    """
    learnt = not np.array_equal(found["levels"], found["seen"])
    if not learnt or _unrest(found) < FAR:
        return found
    edges = [(low * w, high * w) for (low, high), w in zip(found["lines"], found["omega0"], strict=True)]
    other = on_band((min(edges)[0], max(high for _, high in edges) * (1 + BEYOND)))
    return other | {"band_rule": found["band_rule"]} if _unrest(other) < FAR else found


def _unrest(found: dict[str, Any]) -> float:
    """How far levels are from those of the residuals: the log of a ratio; infinite without an end."""
    scale = float(found["scale"])
    return abs(log(scale)) if found["status"] == "ok" and scale > 0 else inf
