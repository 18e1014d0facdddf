"""Studies whose records the user makes: cells of a grid of one's own, each with its generator and truth."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.callables import source
from ..base.words import STATUS
from ..errors import ModfunWarning, SpecError
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from .axes import Axis
from .functions import Failed, attempt, generator, record, refuse_unlike

__all__ = ["Generated", "cells", "grid_axes"]

TRIES = 10  # replicates looked at for a first record, where the generator fails now and then
SEVERAL = 20  # replicates whose bands are looked at where their inputs differ: any one may be unlucky
# What tables and exports of a study call their own columns.
FIGURES = ("bias", "sd", "rmse", "median", "coverage", "crlb", "mean", "share")
RESERVED = (
    *("estimator", "parameter", "replicate", "number", "metric", "true", "truth", "failures", "nit"),
    *FIGURES,
    *[f"{name}_mcse" for name in FIGURES],
    *[f"status_{word}" for word in STATUS],
    *STATUS,
)


@dataclass(frozen=True, eq=False)
class Generated:
    """A cell of the user's grid and the function that makes its records.

    Attributes
    ----------
    index : int
        Address of the random numbers.
    cell : dict of str to label
    generate : callable
        ``generate(cell, rng)`` returns a Record.
    known : dict of str to float
        True parameters by name.
    outputs, inputs : tuple of str
        Channels of every record.
    seen : str
        Hash of the first record.
    """

    index: int
    cell: dict[str, Any]
    generate: Callable[[dict[str, Any], np.random.Generator], Record]
    known: dict[str, float]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    seen: str

    made = True  # in Python, as the core cannot
    scale = 0.0  # nsr means nothing here

    def names(self, structure: TransferFunction | None) -> tuple[str, ...]:
        """Names of a structure's parameters; of no structure: all that are known."""
        return tuple(self.known) if structure is None else structure.param_names(self.inputs, self.outputs)

    def truth(self, structure: TransferFunction | None) -> F64:
        """True parameters in the order of `names`, nan where unknown."""
        return np.array([self.known.get(name, np.nan) for name in self.names(structure)])

    def records(self, seed: int, replicate: int, sigma: Sequence[float]) -> list[Record]:
        """The record of a replicate; `Failed` where there is none."""
        rng = generator("generate", seed, replicate, self.index)
        made = attempt("generate", self.generate, dict(self.cell), rng)
        return [record(made, (self.outputs, self.inputs))]

    def several(self, seed: int) -> list[Record]:
        """Records that default bands are chosen on: one, or the first replicates where inputs differ."""
        found: list[Record] = []
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModfunWarning)
            for replicate in range(SEVERAL):
                try:
                    found += self.records(seed, replicate, ())
                except Failed:
                    continue
                if len(found) == 2 and _same_inputs(*found):
                    return found[:1]
        return found

    @property
    def functions(self) -> dict[str, Any]:
        """Functions of the user by what they are."""
        return {"generate": self.generate}

    def described(self) -> list[Any]:
        """All that its records depend on."""
        return [[self.index, sorted(self.cell.items()), source(self.generate), self.seen]]


def grid_axes(grid: Any) -> tuple[Axis, ...]:
    """The axes of a grid; without one, a single cell."""
    if grid is None:
        return (Axis("cell", ("",), False),)
    if not isinstance(grid, Mapping) or not grid:
        raise SpecError(
            f"MonteCarlo: grid={grid!r}; give a dict from names to lists of labels, as {{'df': [3, 30]}}, or "
            "leave it out"
        )
    found = []
    for name, labels in grid.items():
        if not isinstance(name, str) or not name.strip() or name in RESERVED:
            raise SpecError(
                f"MonteCarlo: grid has an axis named {name!r}; give another text: a column of the tables "
                "has that name"
            )
        if isinstance(labels, str) or not isinstance(labels, Sequence | np.ndarray) or not len(labels):
            raise SpecError(
                f"MonteCarlo: grid has {name}={labels!r}; give a list of at least one number or text"
            )
        plain = tuple(v.item() if isinstance(v, np.generic) else v for v in labels)
        if not all(isinstance(v, str | int | float) for v in plain):
            raise SpecError(f"MonteCarlo: grid has {name}={labels!r}; labels are numbers or texts")
        if len(set(plain)) < len(plain):
            raise SpecError(f"MonteCarlo: grid has {name}={labels!r}; give each label once")
        found.append(Axis(name, plain, True))
    return tuple(found)


def cells(
    axes: Sequence[Axis], generate: Any, truth: Any, seed: int
) -> tuple[tuple[Generated, ...], list[Record]]:
    """Every cell of the grid, and a first record of each, which tells channels and sampling."""
    if not callable(generate):
        raise SpecError(
            f"MonteCarlo: generate is a {type(generate).__name__}; give a function of (cell, rng) that "
            "returns a Record"
        )
    given = [a for a in axes if a.given]
    made, firsts = [], []
    for index, labels in enumerate(product(*(a.labels for a in given))):
        cell = {a.name: label for a, label in zip(given, labels, strict=True)}
        first = _first(generate, cell, seed, index)
        firsts.append(first)
        made.append(
            Generated(
                index=index,
                cell=cell,
                generate=generate,
                known=_known(truth, cell),
                outputs=first.outputs,
                inputs=first.inputs,
                seen=_hash(first),
            )
        )
    return tuple(made), firsts


def _first(generate: Any, cell: dict[str, Any], seed: int, index: int) -> Record:
    said = ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModfunWarning)
        for replicate in range(TRIES):
            try:
                one, two = (
                    record(
                        attempt(
                            "generate", generate, dict(cell), generator("generate", seed, replicate, index)
                        ),
                        None,
                    )
                    for _ in range(2)
                )
            except Failed as failed:
                said = said or str(failed)
                cause = failed.__cause__
                continue
            refuse_unlike("generate", one.y, two.y)
            return one
    raise SpecError(
        f"MonteCarlo: the first {TRIES} replicates of the cell {cell} failed, the first with {said}; a study "
        "needs one record of each cell to begin with"
    ) from cause


def _known(truth: Any, cell: dict[str, Any]) -> dict[str, float]:
    if truth is None:
        return {}
    try:
        found = attempt("", truth, dict(cell)) if callable(truth) else truth
    except Failed as failed:
        raise SpecError(
            f"MonteCarlo: truth failed in the cell {cell} with {failed}; return a dict from parameter names "
            "to numbers for every cell, {} where nothing is known"
        ) from failed.__cause__
    try:
        return {str(name): float(value) for name, value in found.items()}
    except (AttributeError, TypeError, ValueError):
        said = f"returned {found!r} in the cell {cell}" if callable(truth) else f"is {found!r}"
        raise SpecError(
            f"MonteCarlo: truth {said}; give a dict from parameter names to numbers, or a function of the "
            "cell that returns one, {} where nothing is known"
        ) from None


def _same_inputs(one: Record, two: Record) -> bool:
    return np.array_equal(one.u, two.u) and np.array_equal(one.t, two.t)


def _hash(rec: Record) -> str:
    digest = hashlib.sha256()
    for array in (rec.y, rec.u, rec.t):
        digest.update(array.tobytes())
    digest.update(repr((rec.outputs, rec.inputs, rec.intersample)).encode())
    return digest.hexdigest()
