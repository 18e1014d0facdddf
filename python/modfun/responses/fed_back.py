"""Lines where the ends of a record explain the input of a loop, so that only noise fed back is left of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ..base.arrays import C128, F64
from ..records.record import Record
from ..results.innovations import innovations, regressed

__all__ = ["left_of_inputs", "noise_alone"]

Piece = tuple[float, C128, C128]  # line spacing, coefficients of the outputs and of the inputs

PAST = 12  # samples of an input, from which it is predicted
LONG = 60  # of outputs and inputs, from which outputs are
LAGS = 6  # samples after which an input may follow an innovation
SHORTEST, MOST = 8 * LONG, 1 << 16  # samples of a record that is asked
NEW = 1e-3  # of an input's rms: what its past leaves of it is more, or it knows no noise
CERTAIN = 1e-4  # p-value
FOLLOWS = 0.1  # of the power of what is new in an input, at least, that innovations explain
LEFT = 0.05  # of an input's power, that what unknown ends may add leaves of it


def noise_alone(
    records: list[Record],
    pieces: list[Piece],
    omega: F64,
    chosen: NDArray[np.int64],
    degree: int,
    half: Callable[[Piece, int], int],
) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Frequencies at which ends explain the input of a loop, and a message about them.

    Local models then find the inverse of the controller, and as it has no noise of its own, small errors.
    `chosen`: half-widths; `half`: the same in lines of a piece; `degree`: of what ends may add.
    """
    names = records[0].inputs
    ends = left_of_inputs(pieces, range(len(names)), omega, chosen, degree, half) < LEFT
    if not np.any(ends):
        return np.any(ends, axis=0), ()
    loop = {name for rec in records for name in _led(rec)}
    own = [j for j, name in enumerate(names) if name in loop]
    ends = np.any(ends[own], axis=0)
    if not np.any(ends):
        return ends, ()
    return ends, (
        f"At {np.sum(ends)} of {omega.size} frequencies, from {omega[ends].min():.4g} to "
        f"{omega[ends].max():.4g} rad/s, the gains are nan: {' and '.join(names[j] for j in own)} moves "
        "there near the beginning or end of the record only, as sweeps do, which unknown initial and final "
        "states explain as well. The rest is noise that a loop feeds back, of which local models find the "
        "controller instead of the system. First let the record rest before and after the sweep, each for "
        "an eighth of its time or more, or sweep without the loop.",
    )


def _led(rec: Record) -> list[str]:
    """Inputs of a record that follow what is new in its outputs: as in a loop, which feeds noise back.

    C. W. J. Granger, Econometrica 37, 1969. Inputs of the same sample are left out of both regressions, as
    some act at once.
    """
    u, y = rec.u - rec.u.mean(axis=1, keepdims=True), rec.y
    if not SHORTEST <= rec.intervals <= MOST:
        return []
    e = innovations(y, u, LONG, LAGS, [1] * len(u)).e
    return [name for name, row in zip(rec.inputs, u, strict=True) if _follows(row, e)]


def _follows(u: F64, e: F64) -> bool:
    from scipy.special import fdtrc

    size = u.size - LONG
    own = np.array([np.ones(size), *(u[LONG - lag :][:size] for lag in range(1, PAST + 1))])
    late = np.array([row[LONG - lag :][:size] for row in e for lag in range(1, LAGS + 1)])
    alone = float(np.sum(regressed(own, u[LONG:])[1] ** 2))
    both = float(np.sum(regressed(np.concatenate([own, late]), u[LONG:])[1] ** 2))
    if not alone > NEW**2 * float(u @ u) or not alone - both > FOLLOWS * alone:
        return False
    freedom = size - len(own) - len(late)
    return float(fdtrc(len(late), freedom, (alone - both) / len(late) / (both / freedom))) < CERTAIN


def left_of_inputs(
    pieces: list[Piece],
    inputs: Sequence[int],
    omega: F64,
    chosen: NDArray[np.int64],
    degree: int,
    half: Callable[[Piece, int], int],
) -> F64:
    """Share of each input's power, (input, omega), that polynomials leave of it on the lines around.

    They explain unknown ends, too. `degree`: of the polynomials together with those that multiply the output.
    """
    share = np.ones((len(inputs), omega.size))
    for width in np.unique(chosen):
        own = np.flatnonzero(chosen == width)
        left, whole = np.zeros((2, len(inputs), own.size))
        for piece in pieces:
            size = 2 * half(piece, int(width)) + 1
            if not degree + 1 < size < piece[2].shape[1]:
                continue
            start = np.rint(omega[own] / piece[0]).astype(int) - size // 2
            lines = sliding_window_view(piece[2][list(inputs)], size, axis=1)
            lines = lines[:, np.clip(start, 1, lines.shape[1] - 1)]
            basis, _ = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1, 1, size), degree))
            rest = lines - (lines @ basis) @ basis.T
            left += np.sum(np.abs(rest) ** 2, axis=2) / (size - degree - 1)
            whole += np.sum(np.abs(lines) ** 2, axis=2) / size
        share[:, own] = np.divide(left, whole, out=share[:, own], where=whole > 0)
    return share
