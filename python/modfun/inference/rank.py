"""Quick look at the order of a system without fitting: how many directions of the output rise above noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._core import noise_level
from ..base.arguments import public, whole
from ..base.arrays import C128, F64
from ..base.samples import band_edges
from ..base.tables import Table
from ..errors import DataError, SpecError
from ..fitting.fit import records_of
from ..models.options import MOST
from ..records.mask import refuse_own_noise
from ..records.record import Record
from ..responses.coefficients import spectrum
from .common import widest

__all__ = ["rank_test"]


@public
def rank_test(
    data: Record | Sequence[Record],
    *,
    poles: int = 5,
    band: float | tuple[float, float] | None = None,
) -> Table:
    """Singular values of the noise-whitened output columns s^j Y, j = 0 to `poles`.

    From the columns the transient of that order and all s^j U are projected out; what is left of them is
    divided by what white noise alone would leave. A system with n poles has n values above those of noise,
    which lie about 1 (0.4 to 2, for a few dozen lines); a pole that the record hardly excites does not
    rise above them. Nothing is fitted, so it takes a millisecond; `select_order` sees more.

    Parameters
    ----------
    data : Record or sequence of Record
        Evenly sampled. Several outputs, and several records, are taken to have common poles.
    poles : int, default 5
        The highest order looked for.
    band : float or (float, float), optional
        Upper edge, or lower and upper edge, rad/s; default: the wide band of the default rule. A narrower
        one that still holds the response shows weak poles better.

    Returns
    -------
    Table
        Columns poles (k) and singular_value: its kth; and, after the highest order, one that is noise.

    Raises
    ------
    DataError
        Uneven or masked samples, or fewer lines than the columns need.

    See Also
    --------
    modfun.select_order : Compares fitted candidates.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.10.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> table = mf.rank_test(rec)
    >>> len(table) > 0
    True
    """
    q = whole("rank_test", "poles", poles, 1, MOST)
    edges = None if band is None else band_edges("rank_test", band)
    records = records_of(data, "rank_test")
    seen, noise = np.zeros((q + 1, q + 1)), np.zeros((q + 1, q + 1))
    problems = [_lines(rec, edges) for rec in records]
    top = max(float(omega[-1]) for omega, _, _ in problems)
    for rec, (omega, y, u) in zip(records, problems, strict=True):
        if 2 * omega.size <= (q + 1) * (len(rec.inputs) + 2):
            raise DataError(
                f"rank_test: {omega.size} lines are too few for {q} poles and {len(rec.inputs)} inputs; "
                "widen the band or look for fewer poles"
            )
        x = np.asarray(1j * omega / top, dtype=np.complex128)
        level = noise_level(np.ascontiguousarray(rec.y), q)
        for own, sigma in zip(y, level, strict=True):
            if not sigma > 0:
                raise DataError("rank_test: the record carries no noise; select_order needs none")
            data_gram, noise_gram = _grams(x, own, u, q)
            seen += data_gram / (sigma**2 / (2 * rec.intervals))  # of the real and of the imaginary part
            noise += noise_gram
    root = np.linalg.cholesky(noise)
    half = np.linalg.solve(root, np.linalg.solve(root, seen).T)
    values = np.sqrt(np.maximum(np.linalg.eigvalsh(half)[::-1], 0.0))
    return Table({"poles": list(range(1, q + 2)), "singular_value": values})


def _lines(rec: Record, edges: tuple[float, float] | None) -> tuple[F64, C128, C128]:
    """Frequencies and coefficients of outputs and inputs; line 0, which an offset touches, is left out."""
    refuse_own_noise(rec, "rank_test", "take a piece without them, rec.window(start, stop)")
    if rec.dt is None:
        raise DataError("rank_test: the record's steps are uneven; resample it first")
    n, omega0 = rec.intervals, 2 * np.pi / rec.duration
    low, high = (0.0, widest([n], [omega0])) if edges is None else edges
    first, last = max(1, int(np.ceil(min(low / omega0, n) - 1e-9))), int(min(high / omega0, n) + 1e-9)
    if last > n // 2 or last <= first:
        raise SpecError(
            f"rank_test: the band ({low:.4g}, {high:.4g}) rad/s must hold several lines of "
            f"{omega0:.4g} rad/s below {n // 2 * omega0:.4g} rad/s"
        )
    y, u = spectrum(rec, last, "gregory", (0.0,) * len(rec.inputs), 0)
    omega = np.arange(first, last + 1) * float(omega0)
    return omega.astype(np.float64), y[:, first:], u[:, first:]


def _grams(x: C128, y: C128, u: C128, q: int) -> tuple[F64, F64]:
    """Gram matrices of the columns x^j y, the transient and all x^j u projected out.

    That of the data, and what it would be on average with noise of variance one on each real row for y.
    """
    powers = x ** np.arange(q + 1)[:, None]
    removed = np.vstack([powers[:q], *(powers * own for own in u)])
    basis = np.linalg.qr(_rows(removed / np.linalg.norm(removed, axis=1)[:, None]))[0]
    columns = _rows(powers * y)
    columns -= basis @ (basis.T @ columns)
    # Column j of noise is D_j e, D_j multiplication of a line by x^j: its Gram matrix is tr(D_i' P D_j).
    lines = basis[: x.size] + 1j * basis[x.size :]
    turned = np.array([_rows((p.conj()[:, None] * lines).T).ravel() for p in powers])
    return columns.T @ columns, 2 * (powers.conj() @ powers.T).real - turned @ turned.T


def _rows(columns: C128) -> F64:
    """(column, line) complex to (row, column) real: real parts, then imaginary parts."""
    return np.asarray(np.hstack([columns.real, columns.imag]).T, dtype=np.float64)
