"""Plot of a Monte Carlo study: bias and standard deviation over an axis of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from ..base.axes import drawing, returned, take_grid
from ..errors import SpecError
from .figures import Figures

__all__ = ["study", "study_rows"]


@drawing
def study(res: Figures, ax: Any = None) -> Any:
    """Draw bias and standard deviation against NSR, as figure 2 of the report, one row a cell otherwise.

    A study with one noise level is drawn over its first axis with several numbers.

    Both are root mean squares over the parameters in % of the true values; bars are ± 2 Monte Carlo
    standard errors, the dotted line is the Cramér–Rao bound.

    Parameters
    ----------
    res : Results
        Of a study over several noise levels, or over an axis of numbers.
    ax : sequence of Axes, optional
        Bias and standard deviation, for each cell in turn; new ones by default.

    Returns
    -------
    ndarray of Axes, shape (2 · cells,)

    See Also
    --------
    modfun.MonteCarlo.run : Makes the results.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, Fig. 2.

    Examples
    --------
    >>> import modfun as mf
    >>> estimator = mf.Estimator(mf.TransferFunction(poles=2, zeros=0), harmonics=6)
    >>> study = mf.MonteCarlo(
    ...     system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256,
    ...     nsr=[0.1, 0.2], estimators={"ml": estimator},
    ... )
    >>> ax = mf.plot.study(study.run(replicates=100, progress=False))
    >>> [one.get_ylabel() for one in ax]
    ['bias (%)', 'standard deviation (%)']
    """
    over, other, cells = study_rows(res)
    figures = res.relative()
    axes = take_grid(ax, len(cells), 2, "Bias and standard deviation, % of the true values")
    x = np.array(res.axes[over]) * (100 if over == "nsr" else 1)
    for row, cell in enumerate(cells):
        here = np.ones(len(figures), dtype=bool)
        for name, label in zip(other, cell, strict=True):
            here &= figures[name] == label
        for column, (figure, text) in enumerate((("bias", "bias"), ("sd", "standard deviation"))):
            drawn = axes[2 * row + column]
            for k, name in enumerate(res.estimators):
                mine = here & (figures["estimator"] == name)
                drawn.errorbar(
                    x, figures[figure][mine], yerr=2 * figures[f"{figure}_mcse"][mine], label=name,
                    color=f"C{k % 10}", marker="osD^vP*X"[k % 8], markersize=4, linewidth=1.4, capsize=2,
                )  # fmt: skip
            if figure == "sd":
                bound = figures["crlb"][here & (figures["estimator"] == res.estimators[0])]
                if np.any(np.isfinite(bound)):
                    drawn.plot(x, bound, color="0.3", linestyle=":", label="Cramér–Rao bound")
            drawn.set_ylabel(f"{text} (%)")
            drawn.set_title(", ".join(map(str, cell)), fontsize="medium")
            drawn.set_ylim(bottom=0.0)
            drawn.grid(True, alpha=0.3)
            if row == len(cells) - 1:
                drawn.set_xlabel("noise-to-signal ratio (%)" if over == "nsr" else over)
    for drawn in axes[:2]:
        drawn.legend(frameon=False, fontsize="small")
    return returned(ax, axes)


def study_rows(res: Figures) -> tuple[str, list[str], list[tuple[Any, ...]]]:
    """The axis that a study is drawn over, its other axes, and their labels, a row of Axes each."""
    over = next((name for name in ("nsr", *res.axes) if _is_scale(res.axes.get(name, ()))), None)
    if over is None:
        raise SpecError("plot.study: the study has one noise level and no axis of numbers; give nsr a list")
    if not np.any(np.isfinite(res.truth)):
        raise SpecError("plot.study: no parameter's truth is known, so that there is no bias to draw")
    other = [name for name in res.axes if name not in (over, "estimator", "parameter")]
    return over, other, list(product(*(res.axes[name] for name in other)))


def _is_scale(labels: Sequence[Any]) -> bool:
    """Whether an axis has several labels, all numbers."""
    return len(labels) > 1 and not any(isinstance(label, str) for label in labels)
