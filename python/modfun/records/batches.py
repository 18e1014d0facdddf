"""Batches: records of one experiment sampled alike, checked once, here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public
from ..base.arrays import F64
from ..base.between import AUTO, decided, liveliest
from ..base.samples import (
    FEWEST,
    Names,
    floats,
    frozen,
    intersample_of,
    names_of,
    positive,
    refuse_duplicates,
    refuse_nonfinite,
)
from ..errors import DataError, SpecError
from .functions import functions_of
from .mask import sigma_of
from .record import Record

__all__ = ["Batch"]

LOOKED_AT = 8  # replicates, about, that say how the inputs of all go between samples


@public
class Batch:
    """Many records of one experiment, sampled alike: what `fit_many` takes.

    Parameters
    ----------
    y : array_like, shape (replicate, channel, time) or (replicate, time)
        Outputs. A replicate with samples that are not finite gets the status "nonfinite" and leaves the
        others alone.
    u : array_like, optional
        Inputs: (replicate, channel, time), or shared by all replicates: (time,) or (channel, time).
    dt : float
        Sampling interval in seconds.
    sigma : array_like, optional
        Relative noise of the samples, as in `Record`: (replicate, channel, time), or shared by all
        replicates, (time,) or (channel, time). `fit_many` then fits the records one by one.
    outputs, inputs, intersample
        As in `Record`; "auto" looks at the inputs of a few replicates and takes one word for all.

    Attributes
    ----------
    y : ndarray, shape (replicate, channel, time), read only
        The given array itself where it is float64 and C-contiguous, otherwise a copy.
    u : ndarray, shape (replicate or 1, channel, time), read only
        Its first axis is 1 where the inputs are shared.
    dt : float
    sigma : ndarray, shape (replicate or 1, channel, time), read only, or None

    Raises
    ------
    DataError, SpecError
        As in `Record`.

    See Also
    --------
    modfun.Record : One experiment.
    modfun.fit_many : Fits every replicate of a batch.

    References
    ----------
    NumPy broadcasting rules hold for the inputs that replicates share: the guide docs/monte_carlo.md.

    Examples
    --------
    >>> import numpy as np
    >>> import modfun as mf
    >>> t = np.arange(101) * 0.1
    >>> batch = mf.Batch(y=np.sin(t) * np.ones((5, 1, 1)), u=np.cos(t), dt=0.1)
    >>> len(batch)
    5
    """

    __slots__ = ("_told", "dt", "inputs", "intersample", "outputs", "sigma", "u", "y")

    y: F64
    u: F64
    dt: float
    sigma: F64 | None
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    intersample: tuple[str, ...]
    _told: tuple[str, ...]  # the same with "auto" where nobody declared it

    def __init__(
        self,
        y: ArrayLike,
        u: ArrayLike | None = None,
        dt: float | None = None,
        *,
        sigma: ArrayLike | None = None,
        outputs: Names = None,
        inputs: Names = None,
        intersample: str | Sequence[str] | Mapping[str, str] = AUTO,
    ) -> None:
        given = floats(y, "y")
        ys = given[:, None, :] if given.ndim == 2 else given
        if ys.ndim != 3 or 0 in ys.shape:
            raise DataError(f"Batch: y has shape {given.shape}, it must be (replicate, channel, time)")
        if functions_of(u) is not None:
            raise SpecError(
                "Batch: u holds text or functions of t; give fit_many a list of records, "
                "[mf.Record(y, u=..., dt=...) for y in ys], which take these, or samples here"
            )
        us = np.empty((1, 0, ys.shape[2])) if u is None else floats(u, "u")
        if us.ndim == 2 and us.shape[0] == ys.shape[0] > 1:
            raise DataError(
                f"Batch: u of shape {us.shape} may be one input a replicate or {us.shape[0]} inputs shared "
                "by all; give u[:, None, :] for the first, u[None] for the second"
            )
        if us.ndim < 3:
            us = us.reshape((1, *us.shape)) if us.ndim == 2 else us.reshape(1, 1, -1)
        if us.ndim != 3 or us.shape[0] not in (1, ys.shape[0]) or us.shape[2] != ys.shape[2]:
            raise DataError(
                f"Batch: u has shape {us.shape} and y {ys.shape}; u must be (replicate, channel, time), "
                "(channel, time) or (time), with as many samples as y"
            )
        if ys.shape[2] < FEWEST:
            raise DataError(f"Batch: {ys.shape[2]} samples are too few; at least {FEWEST} are needed")
        if ys.shape[1] > ys.shape[2]:
            raise DataError(
                f"Batch: y has {ys.shape[1]} channels of {ys.shape[2]} samples; time must be the last axis: "
                "give np.moveaxis(y, 1, 2)"
            )
        if dt is None:
            raise SpecError("Batch: give dt=, the sampling interval in seconds")
        out_names = names_of(outputs, ys.shape[1], "y", "outputs")
        in_names = names_of(inputs, us.shape[1], "u", "inputs")
        refuse_duplicates((*out_names, *in_names))
        for one in us:
            refuse_nonfinite(in_names, one)
        told = intersample_of(intersample, in_names)
        for name, value in {
            "y": frozen(ys),
            "u": frozen(us),
            "dt": positive(dt, "dt", "seconds"),
            "sigma": _levels(sigma, ys.shape),
            "outputs": out_names,
            "inputs": in_names,
            "intersample": _between(told, us, ys),
            "_told": told,
        }.items():
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a Batch cannot be changed ({name})")

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore_batch, (
            self.y, self.u, self.dt, self.outputs, self.inputs, self._told, self.sigma
        )  # fmt: skip

    @property
    def _declared(self) -> bool:
        """Whether the user said how each input goes between samples."""
        return "auto" not in self._told

    def __len__(self) -> int:
        """Return the number of replicates."""
        return int(self.y.shape[0])

    def __getitem__(self, replicate: int) -> Record:
        """Return one replicate as a Record."""
        u = self.u[replicate if self.u.shape[0] > 1 else 0]
        return Record(
            y=self.y[replicate],
            u=u if len(u) else None,
            dt=self.dt,
            sigma=None if self.sigma is None else self.sigma[replicate if len(self.sigma) > 1 else 0],
            outputs=self.outputs,
            inputs=self.inputs,
            intersample=self._told,
        )._read_as(self.intersample)

    def _finite(self) -> Iterator[Record]:
        """Yield the replicates whose samples are all finite, each looked at only when it is asked for."""
        return (self[k] for k in range(len(self)) if np.isfinite(self.y[k]).all())

    def _read_as(self, words: Mapping[str, str]) -> Batch:
        """Return the batch with these words for inputs, by name."""
        if not words:
            return self
        kinds = [words.get(name, own) for name, own in zip(self.inputs, self.intersample, strict=True)]
        return _restore_batch(self.y, self.u, self.dt, self.outputs, self.inputs, kinds, self.sigma)

    def __repr__(self) -> str:
        replicates, channels, count = self.y.shape
        shared = "shared " if self.u.shape[0] == 1 < replicates else ""
        return (
            f"Batch of {replicates} replicates: {channels} outputs, {self.u.shape[1]} {shared}inputs, "
            f"{count} samples, dt = {self.dt:.6g} s"
        )


def _between(words: Sequence[str], u: F64, y: F64) -> tuple[str, ...]:
    """Return one word an input; where the samples say it, a few replicates decide together."""
    if AUTO not in words:
        return tuple(words)
    each = slice(None, None, max(1, len(u) // LOOKED_AT))
    some = u[each]
    found = [decided(words, one, y=own)[0] for one, own in zip(some, y[: len(u)][each], strict=True)]
    return tuple(
        liveliest(said, rows)
        for said, rows in zip(zip(*found, strict=True), some.swapaxes(0, 1), strict=True)
    )


def _levels(given: ArrayLike | None, shape: tuple[int, ...]) -> F64 | None:
    """Return relative standard deviations (replicate or 1, channel, time)."""
    if given is None:
        return None
    read = floats(given, "sigma")
    alone = shape[1] == 1 and read.shape == (shape[0], shape[2])  # (replicate, time), as y of one output
    each = read[:, None] if alone else read if read.ndim == 3 else read[None]
    if len(each) not in (1, shape[0]):
        raise DataError(
            f"Batch: sigma has shape {read.shape} and y {shape}; sigma must be (replicate, channel, time), "
            "(channel, time) or (time), with as many samples as y"
        )
    times, size = np.arange(float(shape[2])), (shape[1], shape[2])
    return frozen(np.array([sigma_of(own, None, times, size) for own in each]))


def _restore_batch(
    y: F64, u: F64, dt: float, outputs: Names, inputs: Names, words: Sequence[str], sigma: F64 | None = None
) -> Batch:
    given = u if u.shape[1] else None
    return Batch(y, given, dt, sigma=sigma, outputs=outputs, inputs=inputs, intersample=words)
