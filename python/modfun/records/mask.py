"""The mask and sigma of a record: samples of its outputs to leave out, or to trust less."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import F64
from ..base.names import nearest
from ..base.samples import FEWEST, channels_of, floats
from ..errors import DataError, SpecError

__all__ = [
    "Mask", "filled", "hides_much", "leaving_out", "mask_of", "present", "refuse_own_noise", "refuse_scarce",
    "rows_of", "runs", "sample_weights", "scarce", "sigma_of",
]  # fmt: skip

Mask = NDArray[np.bool_]

MUCH = 0.15  # of the samples of an output: what stands in the place of more counts as if it were measured


def mask_of(given: ArrayLike | None, shape: tuple[int, int], axis: int = -1) -> Mask | None:
    """Return a mask (output, time), True where a sample counts; None where all do."""
    if given is None:
        return None
    flags = _per_output(given, "mask", shape, axis)
    other = flags[~np.isin(flags, (0.0, 1.0))]
    if other.size:
        raise DataError(
            f"Record: mask holds {other[0]:g} where True (the sample counts) or False (it is left out) is "
            "needed; give a condition such as mask=np.isfinite(y)"
        )
    mask: Mask = flags == 1.0
    return None if mask.all() else mask


def present(lost: Mask | None, count: int) -> NDArray[np.intp]:
    """Rows of a record that were there, and not lost."""
    return np.arange(count) if lost is None else np.flatnonzero(~lost)


def rows_of(given: Any, outputs: Sequence[str], count: int) -> Any:
    """Return what is given by output as rows (output, time) of ones elsewhere; other things as they are."""
    if not isinstance(given, Mapping):
        return given
    rows = np.ones((len(outputs), count))
    for name, values in given.items():
        if name not in outputs:
            raise SpecError(f"weigh: {name!r} is no output; {nearest(str(name), outputs)}")
        row = _per_output(values, f"what is given for {name!r}", (1, count), -1)
        rows[list(outputs).index(name)] = row[0]
    return rows


def sigma_of(
    given: ArrayLike | None, mask: Mask | None, times: F64, shape: tuple[int, int], axis: int = -1
) -> F64 | None:
    """Return relative standard deviations (output, time), interpolated where samples are masked."""
    if given is None:
        return None
    sigma = filled(_per_output(given, "sigma", shape, axis), mask, times)
    bad = np.argwhere(~(np.isfinite(sigma) & (sigma > 0)))
    if len(bad):
        output, k = bad[0]
        raise DataError(
            f"Record: sigma has {len(bad)} values that are not positive and finite, the first at index {k} "
            f"({sigma[output, k]}); give the relative noise of each sample, and leave samples that say "
            "nothing out with mask="
        )
    return sigma


def _per_output(given: ArrayLike, what: str, shape: tuple[int, int], axis: int) -> F64:
    read = floats(given, what)
    values = channels_of(read, what, axis if read.ndim == 2 else -1)
    if values.shape not in (shape, (1, shape[1])):
        raise DataError(
            f"Record: {what} has shape {np.shape(given)}; it must have one value a sample of y, "
            f"({shape[1]},), or {shape} for one row an output"
        )
    return np.repeat(values, shape[0], axis=0) if values.shape != shape else values


def filled(values: F64, mask: Mask | None, times: F64) -> F64:
    """Return values (channel, time) with lines between the neighbours where samples are masked.

    Before the first and after the last good sample its value is repeated. An output with no good sample
    is left to `refuse_scarce`.
    """
    if mask is None:
        return values
    out = values.copy()
    for row, good in zip(out, mask, strict=True):
        if good.any() and not good.all():
            row[~good] = np.interp(times[~good], times[good], row[good])
    return out


def sample_weights(mask: Mask | None, sigma: F64 | None, shape: tuple[int, ...]) -> F64:
    """Return 1/standard deviation of each sample (output, time) up to a factor, 0 where masked."""
    weights = np.ones(shape) if sigma is None else 1 / sigma
    return weights if mask is None else np.where(mask, weights, 0.0)


def scarce(mask: Mask | None) -> NDArray[np.intp]:
    """Return the outputs of which fewer than 8 samples are left."""
    return np.flatnonzero(mask.sum(axis=1) < FEWEST) if mask is not None else np.zeros(0, dtype=np.intp)


def refuse_scarce(mask: Mask | None, outputs: Sequence[str], what: str) -> None:
    few = scarce(mask)
    if few.size:
        assert mask is not None
        raise DataError(
            f"{what}: the mask leaves {int(mask[few[0]].sum())} samples of output {outputs[few[0]]!r}, at "
            f"least {FEWEST} are needed; mask is True where a sample is good, False where it is left out"
        )


def runs(flags: Mask) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first index and length of each run of True."""
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    starts = np.flatnonzero(edges == 1)
    return starts, np.flatnonzero(edges == -1) - starts


def refuse_own_noise(rec: Any, what: str, cure: str) -> None:
    """Refuse a record with masked samples or a sigma, for what takes every sample alike.

    Raises
    ------
    DataError
    """
    if rec.mask is not None or rec.sigma is not None:
        have = "has samples of unlike sigma"
        if rec.mask is not None:
            have = f"has {int((~rec.mask).sum())} masked samples"
        raise DataError(f"{what}: every sample counts alike here, and the record {have}; {cure}")


def leaving_out(record: Any, name: str, good: str) -> str:
    """Say how to leave samples of one output out, by code that is true of the others."""
    return f"leave them out, rec.weigh(mask={good if len(record.outputs) == 1 else f'{{{name!r}: {good}}}'})"


def hides_much(rec: Any) -> bool:
    """Whether so many samples of an output are masked that what stands in their place counts."""
    return rec.mask is not None and bool(np.min(np.mean(rec.mask, axis=1)) < 1 - MUCH)
