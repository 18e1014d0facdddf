"""What a fit shows of itself: plots as methods, the numbers of a Bode diagram, names for completion."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from ..base.tables import Table
from ..equations.equation import Equation
from ..records.record import Record
from . import derived, drawing, drawing_lines, drawing_sheet
from .estimates import Estimates

__all__ = ["Drawn"]


# Attributes that other files of the package read, and users need not see.
INSIDE = (
    "again", "band_rule", "condition_bound", "content", "denominators", "exact_lines", "facts",
    "free_cost", "gram", "has_poles", "high_band_levels", "instrumented", "interval", "known_level",
    "layout", "level_ratios", "need_numbers", "of_core", "own_values", "pieces", "pole_gradients",
    "process_levels", "record_levels", "record_of", "remarks", "response_gradients", "row_names", "rows",
    "seen", "simulate", "spectrum", "window_weights", "with_past", "without_samples",
)  # fmt: skip


class Drawn(Estimates):
    """Estimates that draw themselves."""

    def __dir__(self) -> list[str]:
        return sorted(set(super().__dir__()).difference(INSIDE))

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.param_names)

    def to_latex(self) -> str:
        """The fitted equations with their estimates, or the fitted transfer functions, as LaTeX.

        Numbers in equations have two significant digits of their standard error; those of transfer
        functions and state spaces are written as the system `model` writes them.

        Returns
        -------
        str
            Mathematics without dollar signs.

        See Also
        --------
        modfun.Equation.to_latex : With the names of parameters.
        """
        from ..equations.symbolic.latex import rounded

        if not isinstance(self.structure, Equation):
            return self.model._repr_latex_().strip("$")
        numbers = {name: f"{value:.6g}" for name, value in self.structure.params if isinstance(value, float)}
        fitted = zip(self.param_names, self.params, self.bse, strict=True)
        return self.structure.to_latex(numbers | {name: rounded(value, se) for name, value, se in fitted})

    def bode(self, omega: ArrayLike | None = None) -> Table:
        """Magnitude in dB and phase in degrees of every path, with standard errors by the delta method.

        Parameters
        ----------
        omega : (f,) array_like, optional
            rad/s; default: 50 frequencies over the fit's band.

        Returns
        -------
        Table
            Columns output and input (with several paths), omega, magnitude_db, magnitude_bse, phase_deg and
            phase_bse, one path after the other. The phase has no jumps of 360 degrees.

        See Also
        --------
        modfun.plot.bode : Draws it.

        References
        ----------
        L. Ljung, System Identification: Theory for the User, Prentice-Hall, 1999, section 9.4.

        Examples
        --------
        >>> import modfun as mf
        >>> system = mf.tf([5], [1, 3, 8])
        >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
        >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
        >>> table = fit.bode([1.0, 2.0])
        >>> table["magnitude_db"].round(1), table["magnitude_bse"].round(2)
        (array([-3.7, -3.3]), array([0.07, 0.07]))
        """
        return derived.bode(self, omega)

    def plot(self, rec: Record | int | None = None, *, hz: bool = False, figure: Any = None) -> Any:
        """Response, Bode plot, residual spectrum and poles on one sheet; see `modfun.plot.fit`."""
        return drawing_sheet.fit(self, rec, hz=hz, figure=figure)

    def plot_response(
        self, rec: Record | int | None = None, *, output: str | None = None, ax: Any = None
    ) -> Any:
        """Measured and simulated outputs with the errors below; see `modfun.plot.response`."""
        return drawing.response(self, rec, ax=ax, output=output)

    def plot_bode(self, *, band: tuple[float, float] | None = None, hz: bool = False, ax: Any = None) -> Any:
        """Bode plot with a 95 % band; see `modfun.plot.bode`."""
        return drawing.bode(self, band=band, hz=hz, ax=ax)

    def plot_residuals(self, *, output: str | None = None, hz: bool = False, ax: Any = None) -> Any:
        """Whitened residual lines and their autocorrelation; see `modfun.plot.residuals`."""
        return drawing_lines.residuals(self, ax=ax, output=output, hz=hz)

    def plot_residual_tests(self, *, output: str | None = None, ax: Any = None) -> Any:
        """Cumulated power and normal quantiles of the residual lines; see `modfun.plot.residual_tests`."""
        return drawing_lines.residual_tests(self, ax=ax, output=output)

    def plot_harmonics(self, rec: Record | int | None = None, *, hz: bool = False, ax: Any = None) -> Any:
        """Spectrum with the used harmonics shaded and the noise level; see `modfun.plot.harmonics`."""
        return drawing_lines.harmonics(self, rec, ax=ax, hz=hz)

    def plot_correlation(self, *, ax: Any = None) -> Any:
        """Correlations of the estimates as a matrix; see `modfun.plot.correlation`."""
        return drawing.correlation(self, ax=ax)

    def plot_poles(self, *, ax: Any = None) -> Any:
        """Poles with 95 % confidence ellipses; see `modfun.plot.poles`."""
        return drawing.poles(self, ax=ax)
