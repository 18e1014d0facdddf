"""What its own past and that of the inputs leave of a record's outputs, and the noise that this makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import C128, F64

__all__ = ["Innovations", "innovations", "regressed"]

DEPENDENT = 1e-10  # of the largest eigenvalue of correlations: below that, columns say the same twice

Column = tuple[int, int]  # which signal of outputs and inputs, in this order, and how many samples before


@dataclass(frozen=True)
class Innovations:
    """One-step prediction errors of outputs, white whatever the colour of the noise.

    Attributes
    ----------
    e : array (output, time)
        The errors, 0 where the past is not known.
    columns : tuple of list of (int, int)
        Signals and lags from which each output is predicted.
    coefficients : tuple of array
        Of these.
    signals : int
        How many outputs and inputs there are.
    """

    e: F64
    columns: tuple[list[Column], ...]
    coefficients: tuple[F64, ...]
    signals: int

    def power(self, turn: F64) -> F64:
        """Power of the noise of each output over that of white noise of variance 1, (output, frequency).

        `turn`: radians a sample. The noise obeys the same regression without the inputs.
        """
        over = np.linalg.pinv(self._polynomials(turn)[0])
        cov = self.e @ self.e.T / self.e.shape[1]
        power: F64 = np.einsum("fij,jk,fik->if", over, cov, over.conj()).real
        return power

    def gain(self, turn: F64) -> C128:
        """From samples of the inputs to those of the outputs, (output, input, frequency)."""
        a, b = self._polynomials(turn)
        return np.moveaxis(np.linalg.pinv(a) @ b, 0, -1)

    def _polynomials(self, turn: F64) -> tuple[C128, C128]:
        """A and B of A y = B u + e, (frequency, output, output or input)."""
        outputs = len(self.e)
        found: C128 = np.zeros((turn.size, outputs, self.signals), dtype=np.complex128)
        for i, (columns, own) in enumerate(zip(self.columns, self.coefficients, strict=True)):
            for (which, lag), c in zip(columns, own.tolist(), strict=True):
                found[:, i, which] += c * np.exp(-1j * turn * lag)
        a: C128 = np.eye(outputs) - found[..., :outputs]
        return a, found[..., outputs:]


def innovations(y: F64, u: F64, past: int, others: int, ahead: Sequence[int]) -> Innovations:
    """Regressions of outputs on `past` samples of their own and of the inputs, and `others` of one another.

    L. Ljung, System Identification, 1999, section 13.4: they are right in a loop, too. `ahead`: of each
    input, the sample after which it is left out, 1 where it acts on later outputs only.
    """
    signals = np.concatenate([y, u])
    signals = signals - signals.mean(axis=1, keepdims=True)
    size, outputs = y.shape[1] - past, len(y)
    e, every, found = np.zeros(y.shape), [], []
    for i in range(outputs):
        columns = [(o, lag) for o in range(outputs) for lag in range(1, (past if o == i else others) + 1)]
        columns += [(outputs + j, lag) for j, first in enumerate(ahead) for lag in range(first, past + 1)]
        rows = np.array([signals[which, past - lag :][:size] for which, lag in columns])
        c, left = regressed(rows, signals[i, past:])
        e[i, past:] = left
        every.append(columns)
        found.append(c)
    return Innovations(e, tuple(every), tuple(found), len(signals))


def regressed(rows: F64, side: F64) -> tuple[F64, F64]:
    """Coefficients of least norm of columns (column, time), which may depend on each other; what is left."""
    products = rows @ rows.T
    sizes = np.sqrt(products.diagonal())
    sizes[sizes == 0] = 1.0
    values, vectors = np.linalg.eigh(products / (sizes * sizes[:, None]))
    kept = vectors[:, values > DEPENDENT * values[-1]]
    c = kept @ ((kept.T @ (rows @ side / sizes)) / values[values > DEPENDENT * values[-1]]) / sizes
    return c, side - c @ rows
