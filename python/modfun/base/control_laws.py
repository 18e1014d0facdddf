"""Inputs that are computed from outputs, sample by sample, as a digital controller does."""

from __future__ import annotations

import numpy as np

from .arrays import F64

__all__ = ["computed"]

LAGS = 2  # samples of a filter of the controller, of outputs and of the input itself
LONGEST = 1 << 12  # samples that are looked at
PER_COLUMN = 10  # samples, at least
EXACT = (
    1e-4  # of the mean change: a controller that runs twice as often as the log leaves 6e-4, rounding 2e-3
)
SHARE = 0.8  # of the samples obey the law; steps of the command and limits break it
ALONE = 0.3  # of them, at most, the past of the input explains alone, as while it rests or follows a servo
TRIMMED = 0.6  # of the samples that regressions use, those that obey best
ROUNDS = 10  # of these; five find the law of a PI controller under steps and limits
GAINS = 0.9  # of what the round before left: from there on nothing more is found


def computed(u: F64, y: F64) -> bool:
    """Tell whether samples of an input obey a control law in those of the outputs, (output, time), exactly.

    Their noise is known at these instants only, so that such an input is computed there, and is held until
    the next. Nothing is told by noise-free outputs, which say what happened between samples, by an input that
    its own past explains, as the position of a servo, nor by one in proportion to them, as a controller
    without a clock makes it.
    """
    u, y = u[:LONGEST], y[:, :LONGEST]
    if u.size < PER_COLUMN * (LAGS + 1) * (len(y) + 1) or not all(map(_noisy, y)):
        return False
    bend, slope = np.diff(u, 2), np.diff(y)[:, 1:]  # a command at rest, and its integral, are not in these
    size = bend.size - LAGS
    late = [slope[:, LAGS - lag :][:, :size] for lag in range(LAGS + 1)]
    own = np.array([bend[LAGS - lag :][:size] for lag in range(LAGS + 1)])
    if not np.any(own[0]) or _share(own[0], np.concatenate([*late, own[1:]])) < SHARE:
        return False
    return _share(own[0], own[1:]) < ALONE and _share(own[0], late[0] - late[1]) < ALONE


def _noisy(values: F64) -> bool:
    """Tell whether bends alternate, as those of noise do; those of a motion follow each other."""
    bend = np.diff(values, 2)
    return float(bend[1:] @ bend[:-1]) < 0.0


def _share(side: F64, rows: F64) -> float:
    """Return the share of samples that a regression explains exactly (least trimmed squares)."""
    rows = np.concatenate([np.ones((1, side.size)), rows])
    sizes = np.abs(rows).mean(axis=1)
    rows = rows[sizes > 0] / sizes[sizes > 0, None]
    size = float(np.abs(side).mean())
    left = np.abs(side) / size + np.abs(rows).sum(axis=0)  # begin where little happens
    best = np.inf
    for _ in range(ROUNDS):
        kept = left <= np.quantile(left, TRIMMED)
        used = rows[:, kept]
        c, *_ = np.linalg.lstsq(used @ used.T, used @ side[kept], rcond=None)
        left = np.abs(side - c @ rows)
        before, best = best, float(np.median(left))
        if best > GAINS * before:
            break
    return float(np.mean(left < EXACT * size))
