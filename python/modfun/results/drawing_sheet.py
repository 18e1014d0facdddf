"""A fit on one sheet: response, Bode plot, residual spectrum, poles."""

from __future__ import annotations

from textwrap import shorten
from typing import Any

from ..base.arguments import shown
from ..base.axes import drawing, name_y
from ..base.optional import optional
from ..errors import SpecError
from ..records.record import Record
from . import drawing as plots
from .drawing_lines import lines_over_frequency
from .estimates import Estimates as Fit  # by the name that users know, which messages show

__all__ = ["fit"]

WIDTH = 6.2  # inches of a column
LONGEST = 130  # letters of the title


@drawing
def fit(fit: Fit, rec: Record | int | None = None, *, hz: bool = False, figure: Any = None) -> Any:
    """Draw a fit on one sheet: response and errors, Bode plot, residual lines and poles.

    What a fit does not have is left out: the Bode plot and poles of nonlinear equations, the Bode plot
    of free motion, the response of a fit that was loaded.

    Parameters
    ----------
    fit : Fit
    rec : Record or int, optional
        The record of the response, or the index of one of the fit's own; default: the first.
    hz : bool, default False
        Frequencies in hertz instead of rad/s; poles stay in rad/s.
    figure : Figure of matplotlib, optional
        Where to draw; a new one by default.

    Returns
    -------
    Figure

    See Also
    --------
    modfun.Fit.report : All of a fit on one page, with tables and tests.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> figure = mf.plot.fit(mf.fit(rec, mf.TransferFunction(poles=2, zeros=0)))
    >>> titles = [here.get_title(loc="left") for here in figure.axes]
    >>> [title for title in titles if title]
    ['Response', 'Frequency response', 'Residual spectrum', 'Poles']
    """
    fit.need_numbers("plot")
    count = len(fit.outputs)
    known = rec is not None or fit.records is not None
    tops = [draw for draw, on in ((_response, known), (_bode, fit.has_poles and bool(fit.inputs))) if on]
    bottoms = [draw for draw, on in ((_lines, bool(fit.lines)), (_poles, fit.has_poles)) if on]
    heights = 2.1 * (1 + count), max(2.4, 1.6 * len(fit.row_names))
    rows = [(draws, height) for draws, height in zip((tops, bottoms), heights, strict=True) if draws]
    if figure is not None and not hasattr(figure, "add_gridspec"):
        raise SpecError(f"plot.fit: figure={shown(figure)} is not a Figure; give one of matplotlib")
    if figure is None:
        pyplot = optional("matplotlib.pyplot", "plot", "plotting")
        size = 2 * WIDTH, 0.5 + sum(height for _, height in rows)
        figure = pyplot.figure(figsize=size, layout="constrained")
    sheet = figure.add_gridspec(len(rows), 2, height_ratios=[height for _, height in rows])
    for at, (draws, _) in enumerate(rows):
        for k, draw in enumerate(draws):
            title, here = draw(fit, figure, sheet[at, k] if len(draws) == 2 else sheet[at, :], rec, hz)
            here.set_title(title, loc="left", fontsize="medium")
    for legend in (here.get_legend() for here in figure.axes):
        for text in legend.get_texts() if legend is not None else ():
            text.set_fontsize("small")  # so that it has its place beside a title
    about = f"{', '.join(fit.inputs) or 'free motion'} → {', '.join(fit.outputs)}: {fit.structure!r}"
    title = f"{about}, {fit.options.method}, {fit.status}"
    figure.suptitle(shorten(title, LONGEST, placeholder=" …"), fontsize="medium")
    return figure


def _panels(figure: Any, place: Any, count: int) -> list[Any]:
    own = place.subgridspec(count, 1)
    axes: list[Any] = []
    for i in range(count):
        axes.append(figure.add_subplot(own[i], sharex=axes[0] if axes else None))
        axes[-1].tick_params(labelbottom=i == count - 1)
    return axes


def _response(fit: Fit, figure: Any, place: Any, rec: Any, hz: bool) -> tuple[str, Any]:
    axes = _panels(figure, place, 2 * len(fit.outputs))
    plots.response(fit, 0 if rec is None else rec, ax=axes)
    many = len(fit.records or ())
    return "Response" + (f" of record 0 of {many}" if rec is None and many > 1 else ""), axes[0]


def _bode(fit: Fit, figure: Any, place: Any, rec: Any, hz: bool) -> tuple[str, Any]:
    axes = _panels(figure, place, 2)
    plots.bode(fit, hz=hz, ax=axes)
    return "Frequency response", axes[0]


def _lines(fit: Fit, figure: Any, place: Any, rec: Any, hz: bool) -> tuple[str, Any]:
    axes = _panels(figure, place, len(fit.row_names))
    for row, here in enumerate(axes):
        lines_over_frequency(here, fit, row, hz=hz)
        here.grid(True, alpha=0.3)
        name_y(here, fit.row_names[row] if len(axes) > 1 else "whitened residual")
        if here is not axes[-1]:
            here.set_xlabel("")
    return "Residual spectrum", axes[0]


def _poles(fit: Fit, figure: Any, place: Any, rec: Any, hz: bool) -> tuple[str, Any]:
    here = figure.add_subplot(place)
    plots.poles(fit, ax=here)
    return "Poles", here
