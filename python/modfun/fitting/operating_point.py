"""Equations that hold at the levels before a record: what that says of both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..records.record import Record

__all__ = ["OperatingPoint"]

SURE = 1e-10  # of the largest: variance of what equations at rest leave that counts as none
ROUNDS = 20
SETTLED = 1e-6  # of a standard error


class OperatingPoint:
    """Equations without a free constant, at rest under the inputs' first values.

    They hold there exactly, g(x) = 0 of x = (parameters, levels), while the lines of a narrow band see the
    past through the noise behind it. Estimates x with covariance V and a likelihood that is normal about them
    leave x − Kg, K = VGᵀ(GVGᵀ)⁻¹, with G = ∂g/∂x, as the likeliest that hold; their errors are (1 − KG)
    times those of x. Where g is not linear, G is taken there, in rounds.
    """

    def __init__(self, records: Sequence[Record], at_rest: Callable[..., Any]) -> None:
        self.records, self.at_rest = records, at_rest

    @classmethod
    def of(cls, records: Sequence[Record], structure: Any) -> OperatingPoint | None:
        """That of records by their outputs; None where signals that are not measured rest, too."""
        compiled = structure.compiled(records[0].outputs, records[0].inputs)
        if compiled.hidden:
            return None
        return cls(
            records, _at_rest(compiled.source, (compiled.outputs, compiled.inputs), compiled.parameters)
        )

    def tied(self, x: F64, covs: Mapping[str, F64], by: str) -> tuple[F64, dict[str, F64]] | None:
        """Parameters and levels (record by record) that hold, and their covariances, from V = `covs[by]`.

        None where no such values are found.
        """
        now, v = x, covs[by]
        for _ in range(ROUNDS):
            gap, slopes = self._left(now)
            if not (np.isfinite(gap).all() and np.isfinite(slopes).all()):
                return None
            size = np.sqrt(np.einsum("ij,jk,ik->i", slopes, v, slopes))
            told = size > 0
            gap, slopes = gap[told] / size[told], slopes[told] / size[told, None]
            inverse = np.linalg.pinv(slopes @ v @ slopes.T, rcond=SURE, hermitian=True)
            gain = v @ slopes.T @ inverse
            before, now = now, x - gain @ (gap + slopes @ (x - now))
            if np.all(np.abs(now - before) <= SETTLED * np.sqrt(np.diag(v))):
                left = np.eye(x.size) - gain @ slopes
                return now, {name: left @ cov @ left.T for name, cov in covs.items()}
        return None

    def _left(self, x: F64) -> tuple[F64, F64]:
        """g, (record and equation,), and G, (record and equation, parameter and level)."""
        outputs = len(self.records[0].outputs)
        own = x.size - outputs * len(self.records)
        gaps, slopes = [], []
        for k, rec in enumerate(self.records):
            at = own + k * outputs
            with np.errstate(all="ignore"):
                gap, to_params, to_levels = self.at_rest(x[:own], x[at : at + outputs], rec.u[:, 0])
            row = np.zeros((len(gap), x.size))
            row[:, :own], row[:, at : at + outputs] = to_params, to_levels
            gaps.append(np.ravel(gap))
            slopes.append(row)
        return np.concatenate(gaps).astype(float), np.vstack(slopes)


@lru_cache(64)
def _at_rest(
    source: tuple[Any, ...], channels: tuple[tuple[str, ...], ...], parameters: tuple[str, ...]
) -> Callable[..., Any]:
    """What equations leave at rest, and its derivatives to parameters and outputs, of these and inputs."""
    import sympy

    from ..equations.symbolic.compiled import Delayed, jet

    own, outputs, inputs = ([jet(name) for name in names] for names in (parameters, *channels))
    left = sympy.Matrix([one.replace(Delayed, lambda signal, _: signal) for one in source])
    left = left.subs({symbol: 0 for symbol in left.free_symbols - {*own, *outputs, *inputs}})  # derivatives
    slopes = [left.jacobian(symbols).replace(sympy.DiracDelta, lambda *_: 0) for symbols in (own, outputs)]
    made: Callable[..., Any] = sympy.lambdify([own, outputs, inputs], [left, *slopes])
    return made
