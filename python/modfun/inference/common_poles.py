"""What the outputs of a fit with separate denominators have in common: poles and zeros, tested."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from ..base import html
from ..base.arguments import public
from ..base.arrays import C128, F64
from ..base.student import probability, root
from ..base.tables import Table
from ..errors import SpecError
from ..results.fit import Fit
from ..results.gradients import root_gradients

__all__ = ["CommonPoles", "common_poles"]


@public
@dataclass(frozen=True, eq=False, repr=False)
class CommonPoles:
    """Poles and zeros that outputs share, as far as the data tell; see `common_poles`.

    Attributes
    ----------
    poles, zeros : Table
        One row per distinct value: pole or zero (rad/s; upper one of a complex pair), omega, omega_bse, the
        outputs that have it, p_value of the test that theirs are one (nan where a single output has it).
    denominator : ndarray, shape (n,), or None
        a1 … an of the one denominator that explains all best; None where the orders differ.
    cov : ndarray, shape (n, n), or None
        Its covariance.
    chi2, df, p_value : float, int, float
        Test that all outputs have this denominator; nan where the orders differ.
    notes : tuple of str
        The outcome in sentences.

    See Also
    --------
    modfun.common_poles : Makes it.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.6.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([[[1, 2]], [[0.5]]], [1, 1.2, 4])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=20.0, intervals=500, nsr=0.02, seed=0)
    >>> structure = mf.TransferFunction(poles=2, zeros=[[1], [0]], denominator="separate")
    >>> fit = mf.fit(rec, structure, harmonics=30)
    >>> common = mf.common_poles(fit)
    >>> len(common.poles)
    1
    """

    poles: Table
    zeros: Table
    denominator: F64 | None
    cov: F64 | None
    chi2: float
    df: int
    p_value: float
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        return "\n".join([repr(self.poles), "", repr(self.zeros), "", *self.notes])

    def _repr_html_(self) -> str:
        return self.poles._repr_html_() + self.zeros._repr_html_() + html.listing(self.notes)


@dataclass(frozen=True)
class _Root:
    """A root of one output's polynomial with its derivatives (parameter)."""

    output: int
    value: complex
    gradient: C128

    @property
    def is_real(self) -> bool:
        return self.value.imag == 0


@public
def common_poles(fit: Fit, *, level: float = 0.01) -> CommonPoles:
    """Find the poles and zeros that outputs share, by reducing a fit with separate denominators.

    Roots of different outputs are treated as one where a Wald test with the fit's covariance does not object,
    the closest first; the shared value is the one that explains all of them best (generalised least squares
    with their covariance). Where all orders agree, all denominators are tested at once: what is reduced is
    the vector of their coefficients, to the one denominator of the report's eq. (25).

    Parameters
    ----------
    fit : Fit
        With ``denominator="separate"`` (report, eq. 26).
    level : float, default 0.01
        Significance at which the data object.

    Returns
    -------
    CommonPoles

    Raises
    ------
    SpecError
        A fit whose outputs have one denominator anyway.

    See Also
    --------
    modfun.CommonPoles : What it returns.
    modfun.TransferFunction : `denominator='common'` shares all poles.

    Notes
    -----
    Not to object is no proof: a record that tells little objects to little. Compare with the standard errors.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.6.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([[[1, 2]], [[0.5]]], [1, 1.2, 4])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=20.0, intervals=500, nsr=0.02, seed=0)
    >>> structure = mf.TransferFunction(poles=2, zeros=[[1], [0]], denominator="separate")
    >>> fit = mf.fit(rec, structure, harmonics=30)
    >>> common = mf.common_poles(fit)
    >>> len(common.poles)
    1
    """
    if not isinstance(fit, Fit) or fit.layout.common:
        raise SpecError(
            'common_poles: takes a fit of several outputs with denominator="separate"; here there is one '
            "denominator"
        )
    level = probability("common_poles", level)
    fit.need_numbers("common_poles")
    cov = fit.cov_params()
    outputs = range(len(fit.outputs))
    poles = [root for i in outputs for root in _upper(i, fit.pole_gradients(i))]
    zeros = [root for i in outputs for root in _zeros(fit, i)]
    shared = [_merged(roots, cov, level) for roots in (poles, zeros)]
    tables = [_table(fit, groups, cov, name) for groups, name in zip(shared, ("pole", "zero"), strict=True)]
    denominator, own, chi2, df, p_value = _reduced(fit, cov)
    return CommonPoles(
        poles=tables[0],
        zeros=tables[1],
        denominator=denominator,
        cov=own,
        chi2=chi2,
        df=df,
        p_value=p_value,
        notes=_notes(shared[0], chi2, df, p_value, level),
    )


def _upper(output: int, found: tuple[C128, C128]) -> list[_Root]:
    """Real roots and the upper ones of pairs."""
    return [_Root(output, complex(r), slope) for r, slope in zip(*found, strict=True) if r.imag >= 0]


def _zeros(fit: Fit, output: int) -> list[_Root]:
    _, nums = fit.polynomials(output)
    found = []
    for num, first, degree in zip(
        nums, fit.layout.places[1][output], fit.layout.numerators[output], strict=True
    ):
        if degree:
            places = fit.layout.positions[first : first + degree + 1]
            found += _upper(output, root_gradients(num, places, fit.params.size))
    return found


def _planes(roots: list[_Root]) -> tuple[F64, F64]:
    """Real coordinates of roots of one kind, (root × (1 or 2)), and their gradients."""
    if roots[0].is_real:
        return np.array([r.value.real for r in roots]), np.array([r.gradient.real for r in roots])
    values = [x for r in roots for x in (r.value.real, r.value.imag)]
    return np.array(values), np.array([g for r in roots for g in (r.gradient.real, r.gradient.imag)])


def _one(roots: list[_Root], cov: F64) -> tuple[F64, F64, float]:
    """The value that explains some roots best, its covariance, and the p-value of their being one."""
    from scipy.special import chdtrc

    values, gradients = _planes(roots)
    spread = gradients @ cov @ gradients.T
    width = 1 if roots[0].is_real else 2
    design = np.tile(np.eye(width), (len(roots), 1))
    inverse = np.linalg.pinv(spread, rcond=1e-12, hermitian=True)
    own: F64 = np.linalg.pinv(design.T @ inverse @ design, rcond=1e-14, hermitian=True).astype(np.float64)
    value = own @ design.T @ inverse @ values
    left = values - design @ value
    df = width * (len(roots) - 1)
    return value, own, float(chdtrc(df, left @ inverse @ left)) if df else float("nan")


def _merged(roots: list[_Root], cov: F64, level: float) -> list[list[_Root]]:
    """Groups of roots that may be one, the likeliest joined first; none has two of one output."""
    groups = [[root] for root in roots]
    while True:
        best, pair = level, None
        for a, b in combinations(range(len(groups)), 2):
            both = groups[a] + groups[b]
            alike = len({r.is_real for r in both}) == 1 and len({r.output for r in both}) == len(both)
            if alike and np.all(np.isfinite([r.gradient for r in both])):
                p_value = _one(both, cov)[2]
                if p_value > best:
                    best, pair = p_value, (a, b)
        if pair is None:
            return groups
        groups[pair[0]] += groups.pop(pair[1])


def _table(fit: Fit, groups: list[list[_Root]], cov: F64, name: str) -> Table:
    columns: dict[str, list[Any]] = {name: [], "omega": [], "omega_bse": [], "outputs": [], "p_value": []}
    for roots in sorted(groups, key=lambda g: abs(g[0].value)):
        value, own, p_value = _one(roots, cov)
        size = float(np.linalg.norm(value))
        way = value / size if size > 0 else np.ones_like(value) / np.sqrt(value.size)
        columns[name].append(complex(value[0], value[1] if value.size == 2 else 0.0))
        columns["omega"].append(size)
        columns["omega_bse"].append(float(root(way @ own @ way)))
        columns["outputs"].append(
            ", ".join(fit.outputs[r.output] for r in sorted(roots, key=lambda r: r.output))
        )
        columns["p_value"].append(p_value)
    return Table(columns, units=dict.fromkeys((name, "omega", "omega_bse"), "rad/s"))


def _reduced(fit: Fit, cov: F64) -> tuple[F64 | None, F64 | None, float, int, float]:
    """One denominator for all by generalised least squares, and the test that there is one."""
    from scipy.special import chdtrc

    orders, firsts = fit.layout.orders, fit.layout.places[0]
    rows = [
        [fit.layout.positions[first + k] for k in range(n)] for first, n in zip(firsts, orders, strict=True)
    ]
    if len(set(orders)) > 1 or any(at is None for row in rows for at in row):
        return None, None, float("nan"), 0, float("nan")
    index = np.array(rows, dtype=int)
    values, spread = fit.params[index.ravel()], cov[np.ix_(index.ravel(), index.ravel())]
    scale = np.sqrt(np.diag(spread))
    inverse = np.linalg.inv(spread / np.outer(scale, scale))
    design = np.tile(np.eye(orders[0]), (len(orders), 1)) / scale[:, None]
    own: F64 = np.linalg.inv(design.T @ inverse @ design).astype(np.float64)
    found = own @ design.T @ inverse @ (values / scale)
    left = values / scale - design @ found
    chi2, df = float(left @ inverse @ left), int(values.size - orders[0])
    return found, own, chi2, df, float(chdtrc(df, chi2))


def _notes(groups: list[list[_Root]], chi2: float, df: int, p_value: float, level: float) -> tuple[str, ...]:
    notes = []
    if np.isnan(p_value):
        notes.append(
            "The denominators are of different order or partly held; they are not tested as a whole."
        )
    elif p_value < level:
        notes.append(
            f"The data object to one denominator for all outputs: chi-square {chi2:.4g} for {df} degrees of "
            f"freedom, p = {p_value:.2g}."
        )
    else:
        notes.append(
            f"The data do not object to one denominator for all outputs (chi-square {chi2:.4g} for {df} "
            f'degrees of freedom, p = {p_value:.2g}): denominator="common" would spend fewer parameters.'
        )
    count = sum(len(roots) > 1 for roots in groups)
    notes.append(
        f"{count} of {len(groups)} distinct poles (complex pairs once) are shared by several outputs."
    )
    return tuple(notes)
