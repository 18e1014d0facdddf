"""How long the inputs of a record stand at its beginning."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from .record import Record

__all__ = ["QUIET", "standing"]

QUIET = 4  # samples with steady inputs before which a record is not taken to begin at rest


def standing(rec: Record, past: ArrayLike | None = None) -> int:
    """Samples before the first in which an input is not as in the first one, or in the `past`, (input, 1).

    0 where no input ever moves.
    """
    moving = np.any(rec.u != (rec.u[:, :1] if past is None else past), axis=0)
    return int(np.argmax(moving))
