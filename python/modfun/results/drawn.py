"""The plots of a fit as methods."""

from __future__ import annotations

from typing import Any

from ..records.record import Record
from . import drawing, drawing_lines, drawing_sheet
from .estimates import Estimates

__all__ = ["Drawn"]


class Drawn(Estimates):
    """Estimates that draw themselves."""

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
