"""How long the inputs of a record stand at its beginning, and whether its outputs do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from .record import Record

__all__ = ["QUIET", "flat", "standing"]

QUIET = 4  # samples with steady inputs before which a record is not taken to begin at rest
SEEN = 12  # the same, before which nothing shows that its outputs stand, too
BENT, UNLIKELY = 2, 0.01  # degree of what outputs would follow, and p-value below which they do


def standing(rec: Record, past: ArrayLike | None = None) -> int:
    """Samples before the first in which an input is not as in the first one, or in the `past`, (input, 1).

    0 where no input ever moves.
    """
    moving = np.any(rec.u != (rec.u[:, :1] if past is None else past), axis=0)
    return int(np.argmax(moving))


def flat(rec: Record) -> bool:
    """Whether outputs plainly stand while the inputs of an even record do: they follow no parabola."""
    from scipy.special import fdtrc

    count = standing(rec)
    if count < SEEN:
        return False
    y, free = rec.y[:, :count], count - 1 - BENT
    y = y - np.mean(y, axis=1, keepdims=True)
    basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, count), BENT + 1))[0]
    told = np.sum((y @ basis) ** 2, axis=1)
    left = np.sum(y**2, axis=1) - told
    with np.errstate(all="ignore"):
        p = fdtrc(BENT, free, told / BENT / (left / free))
    return bool(np.all((p > UNLIKELY) | (np.ptp(y, axis=1) == 0)))
