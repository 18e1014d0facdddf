"""Models of lower order: balanced truncation, then weighted least squares on the frequency response."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base import html
from ..base.arguments import public
from ..base.arrays import F64
from ..base.names import nearest
from ..base.tables import Table
from ..errors import SpecError
from ..models.transfer_function import TransferFunction
from ..systems.lti import LTI
from . import drawing
from .criterion import measured
from .norms import largest_gain
from .reducible import Lines, read_system
from .steps import Found, of_lines, to_order, to_structure

__all__ = ["Reduction", "reduce"]


METHODS = ("awls", "balanced")


@public
@dataclass(frozen=True, eq=False, repr=False)
class Reduction:
    """A model of lower order and how far it is from the system; made by `reduce`.

    Attributes
    ----------
    model : LTI
        The reduced model.
    h2_error : float
        H2 norm of the difference, √(1/2π ∫ ‖G − Ĝ‖² dω), which is the energy of the difference of impulse
        responses, rooted. Over all frequencies; of a frequency response over its lines, and of systems
        whose difference is not stable over the band. inf where it does not exist.
    hinf_error : float
        H-infinity norm of the difference, the largest gain over frequencies and directions; over the same.
    hankel : ndarray
        Hankel singular values of the stable part, descending; empty for a frequency response.
    bound : float
        Twice the sum of the Hankel singular values left out: what `hinf_error` of balanced truncation
        cannot exceed. nan for a frequency response.
    errors : Table
        One row per model (this one, and balanced truncation to the same order): h2, h2_relative, hinf,
        hinf_relative, largest_relative (of ‖G − Ĝ‖/‖G‖, down to 80 dB below the largest ‖G‖), cost (the
        criterion that was minimised).
    nit : int
        Iterations.
    status : {"ok", "maxiter", "nonfinite"}
    notes : tuple of str
        What was kept, left out or not possible, in sentences.

    See Also
    --------
    modfun.reduce : Makes it.
    modfun.plot.reduction : Draws it.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.5; K. Glover, All optimal Hankel-norm
    approximations, Int. J. Control 39, 1984 (the bound).

    Examples
    --------
    >>> import modfun as mf
    >>> reduction = mf.reduce(mf.tf([1, 7, 24, 24], [1, 10, 35, 50, 24]), 2)
    >>> f"{reduction.hinf_error:.4f} of at most {reduction.bound:.4f}"
    '0.0248 of at most 0.0260'
    """

    model: LTI
    h2_error: float
    hinf_error: float
    hankel: F64
    bound: float
    errors: Table
    nit: int
    status: str
    notes: tuple[str, ...]
    _found: Found = field(repr=False)

    @property
    def success(self) -> bool:
        """True where the iteration ended by itself, in finite numbers."""
        return self.status == "ok"

    def summary(self) -> str:
        """Errors beside those of balanced truncation, Hankel singular values and notes, as text."""
        shown = ", ".join(f"{value:.4g}" for value in self.hankel[:10])
        lines = [repr(self.errors)]
        if self.hankel.size:
            more = ", …" if self.hankel.size > 10 else ""
            lines += [
                f"Hankel singular values: {shown}{more}",
                f"bound of balanced truncation: {self.bound:.4g}",
            ]
        return "\n".join([*lines, *self.notes])

    def __repr__(self) -> str:
        return self.summary()

    def _repr_html_(self) -> str:
        model = f"<pre>{html.escape(repr(self.model))}</pre>"
        return self.errors._repr_html_() + html.listing(self.notes) + model

    def gains(self) -> tuple[F64, dict[str, F64]]:
        """Frequencies, rad/s, and the largest gains there of the system, the models, and their differences.

        Without delays that are kept and poles that are; those are in no difference.
        """
        found = self._found
        grid = found.criterion.grid
        low, high = found.target.range
        near = (grid.omega >= low) & (grid.omega <= high)
        omega, data = grid.omega[near], grid.response[near]
        curves = {"system": largest_gain(data)}
        models = {name: gains(grid.omega)[near] for name, gains, _ in found.contenders}
        curves["model"] = largest_gain(models["this"])
        for name, own in models.items():
            curves["error" if name == "this" else f"error of {name}"] = largest_gain(data - own)
        return omega, curves

    def plot(self, *, ax: Any = None, hz: bool = False) -> Any:
        """Gains of the system, the model and their difference; see `modfun.plot.reduction`."""
        return drawing.gains(*self.gains(), ax, hz)


@public
def reduce(
    system: Any,
    structure: int | TransferFunction,
    *,
    weight: str | Callable[[F64], Any] | Any = "h2",
    band: float | tuple[float, float] | None = None,
    method: str = "awls",
    dcgain: bool = False,
) -> Reduction:
    """Reduce a system, or a frequency response, to a model of lower order.

    Parameters
    ----------
    system : LTI, Fit, FrequencyResponse, (A, B, C) or (A, B, C, D), or of python-control or SciPy
        A may be a sparse matrix of SciPy, and then of any order as long as the system is stable; dense ones
        are meant up to about 2,000 states. A frequency response has no states; it is fitted on its lines.
    structure : int or TransferFunction
        Number of poles: of a system the outcome is a state space of that order, of a frequency response
        transfer functions with one denominator. Or a structure, with held or bounded parameters if wanted;
        with several outputs it says whether they share their denominator.
    weight : {"h2", "flat", "relative"}, callable or array, default "h2"
        "h2": the least H2 norm of the difference. "flat": the least H-infinity norm, found by reweighting.
        "relative": the difference over the size of the response, all decades alike. A function f(omega)
        multiplies the difference in the H2 norm. An array does so with the lines of a frequency response,
        (omega,) or (output, input, omega).
    band : float or (float, float), optional
        Frequencies that count, rad/s. Default: all.
    method : {"awls", "balanced"}
        "awls": least squares, begun at balanced truncation and, for structures, at other places too.
        "balanced": balanced truncation itself; of a structure the number of poles counts.
    dcgain : bool, default False
        Keep the gain at 0 rad/s exactly. Balanced truncation then takes the left-out states as settled.

    Returns
    -------
    Reduction

    Raises
    ------
    SpecError
        An order that is no reduction, a word that is not known, a structure for other channels.
    DataError
        A sparse system that is not stable, numbers that are not finite, too few lines.

    See Also
    --------
    modfun.Reduction : What it returns.
    modfun.FrequencyResponse : Gains instead of a system.

    Notes
    -----
    Poles that are not stable, integrators among them, are kept with their residues and count as poles of
    the model. Delays of inputs are kept when an order is asked for, or where the structure has the same;
    where it has none, poles stand in for them.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.5; B. C. Moore, Principal component
    analysis in linear systems, IEEE Trans. Autom. Control 26, 1981.

    Examples
    --------
    >>> import modfun as mf
    >>> reduction = mf.reduce(mf.tf([1, 7, 24, 24], [1, 10, 35, 50, 24]), 2)
    >>> f"{reduction.hinf_error:.4f} of at most {reduction.bound:.4f}"
    '0.0248 of at most 0.0260'
    """
    _checked(structure, method)
    full = read_system(system)
    if isinstance(full, Lines):
        if method == "balanced":
            raise SpecError("reduce: a frequency response has no states to balance; use method='awls'")
        found, hankel = of_lines(full, structure, weight, band, dcgain), np.zeros(0)
    else:
        hankel = full.balanced.hankel
        if isinstance(structure, TransferFunction) and method == "awls":
            found = to_structure(full, structure, weight, band, dcgain)
        else:
            found = to_order(full, structure, weight, band, method, dcgain)
    names = [name for name, _, _ in found.contenders]
    rows = [measured(found.target, found.criterion, gains, model) for _, gains, model in found.contenders]
    return Reduction(
        model=found.model,
        h2_error=rows[0]["h2"],
        hinf_error=rows[0]["hinf"],
        hankel=hankel,
        bound=float(2 * np.sum(hankel[found.kept_states :])) if len(rows) > 1 else float("nan"),
        errors=Table({"model": names, **{name: [row[name] for row in rows] for name in rows[0]}}),
        nit=found.nit,
        status=found.status,
        notes=tuple(found.notes),
        _found=found,
    )


def _checked(structure: Any, method: str) -> None:
    if method not in METHODS:
        raise SpecError(f"reduce: method={method!r} is not available; {nearest(method, METHODS)}")
    if isinstance(structure, bool) or not isinstance(structure, int | np.integer | TransferFunction):
        raise SpecError(
            f"reduce: the second argument is {structure!r}; give the number of poles or "
            "mf.TransferFunction(...)"
        )
    if isinstance(structure, int | np.integer) and structure < 1:
        raise SpecError(f"reduce: {structure} poles; give at least 1")
