"""Plots of the single estimates of a study: how they are distributed, and whether normally."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.axes import drawing, returned, take_grid
from ..errors import SpecError
from .figures import Figures

__all__ = ["histogram", "quantiles"]

BINS = 40
POINTS = 199  # quantiles drawn of many estimates
ACROSS = 3  # panels in a row
FENCE = 3.0  # widths of the middle half: what is farther from it would squeeze all others into one bar


@drawing
def histogram(res: Figures, ax: Any = None) -> Any:
    """Draw how the estimates of each parameter are distributed in one cell of a study; dashed the true value.

    Parameters
    ----------
    res : Results
        Of a study run with ``keep="samples"``, of one cell: ``res.sel(nsr=0.2)``.
    ax : sequence of Axes, optional
        One per parameter; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one parameter.

    See Also
    --------
    modfun.Results.sel : One cell of a study.
    modfun.plot.quantiles : Whether the estimates are normal.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> study = mf.MonteCarlo(
    ...     system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2,
    ...     estimators=["ml"],
    ... )
    >>> ax = mf.plot.histogram(study.run(replicates=200, progress=False, keep="samples"))
    >>> [one.get_xlabel() for one in ax]
    ['a1', 'a2', 'b0']
    """
    panels = _panels(res, "histogram")
    axes = _axes(ax, len(panels), "Estimates")
    for here, (name, truth, found) in zip(axes, panels, strict=True):
        whole = np.concatenate(list(found.values()))
        low, high = _shown(whole)
        room = 0.05 * (high - low) or 1.0
        for k, (estimator, values) in enumerate(found.items()):
            edges = np.linspace(low - room, high + room, BINS + 1)
            here.hist(values, bins=edges, density=True, histtype="stepfilled", alpha=0.25, color=f"C{k % 10}")
            here.hist(values, bins=edges, density=True, histtype="step", color=f"C{k % 10}", label=estimator)
        if np.isfinite(truth):
            here.axvline(truth, color="0.2", linestyle="--", linewidth=1.0, label="true value")
        here.set_xlabel(name)
        here.set_ylabel("density")
    return _ended(ax, axes)


def _shown(values: F64) -> tuple[float, float]:
    """Between which values bars are drawn: nearly all estimates, without those that are far off."""
    low, q1, q3, high = np.quantile(values, [0.001, 0.25, 0.75, 0.999]).tolist()
    reach = FENCE * (q3 - q1)
    return (max(low, q1 - reach), min(high, q3 + reach)) if reach > 0 else (low, high)


@drawing
def quantiles(res: Figures, ax: Any = None) -> Any:
    """Draw the estimates of each parameter in one cell of a study against normal quantiles.

    Normal estimates lie on the straight line, which has their mean and standard deviation.

    Parameters
    ----------
    res : Results
        As in `histogram`.
    ax : sequence of Axes, optional
        One per parameter; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one parameter.

    See Also
    --------
    modfun.plot.histogram : The same estimates as histograms.

    References
    ----------
    M. B. Wilk, R. Gnanadesikan, Probability plotting methods for the analysis of data, Biometrika 55, 1968.

    Examples
    --------
    >>> import modfun as mf
    >>> study = mf.MonteCarlo(
    ...     system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2,
    ...     estimators=["ml"],
    ... )
    >>> ax = mf.plot.quantiles(study.run(replicates=200, progress=False, keep="samples"))
    >>> [one.get_ylabel() for one in ax]
    ['a1', 'a2', 'b0']
    """
    from scipy.special import ndtri

    panels = _panels(res, "quantiles")
    axes = _axes(ax, len(panels), "Estimates against normal quantiles")
    for here, (name, _, found) in zip(axes, panels, strict=True):
        for k, (estimator, values) in enumerate(found.items()):
            count = min(values.size, POINTS)
            share = (np.arange(count) + 0.5) / count
            normal = ndtri(share)
            here.plot(normal, np.quantile(values, share), ".", color=f"C{k % 10}", label=estimator)
            line = values.mean() + values.std() * normal[[0, -1]]
            here.plot(normal[[0, -1]], line, color=f"C{k % 10}", linewidth=0.8)
        here.set_xlabel("normal quantile")
        here.set_ylabel(name)
    return _ended(ax, axes)


def _panels(res: Figures, what: str) -> list[tuple[str, float, dict[str, F64]]]:
    """Of each parameter its name, its true value and the estimates by estimator."""
    if res.samples is None:
        raise SpecError(f"plot.{what}: the study kept no estimates; run it with keep='samples'")
    several = [name for name, own in list(res.axes.items())[:-2] if len(own) > 1]
    if several:
        label = res.axes[several[0]][0]
        raise SpecError(
            f"plot.{what}: the study has several cells; choose one, as res.sel({several[0]}={label!r})"
        )
    samples = res.samples.reshape(len(res.estimators), -1, len(res.param_names))
    truth = res.truth.reshape(len(res.estimators), -1)
    found = list(_finite(res, samples, truth))
    if not found:
        raise SpecError(f"plot.{what}: there are no estimates in this cell")
    return found


def _finite(res: Figures, samples: F64, truth: F64) -> Iterator[tuple[str, float, dict[str, F64]]]:
    for p, name in enumerate(res.param_names):
        own = {e: samples[k, :, p] for k, e in enumerate(res.estimators)}
        own = {e: values[np.isfinite(values)] for e, values in own.items()}
        if own := {e: values for e, values in own.items() if values.size}:
            known = truth[np.isfinite(truth[:, p]), p]
            yield name, float(known[0]) if known.size else float("nan"), own


def _axes(ax: Any, count: int, title: str) -> list[Any]:
    if ax is not None and count == 1 and hasattr(ax, "plot"):
        return [ax]
    across = min(count, ACROSS)
    shape = (-(-count // across), across) if ax is None else (1, count)
    axes = take_grid(ax, *shape, title, sharex=False)
    for spare in axes[count:]:
        spare.remove()
    return axes[:count]


def _ended(ax: Any, axes: list[Any]) -> Any:
    for here in axes:
        here.grid(True, alpha=0.3)
    axes[0].legend(frameon=False, fontsize="small")
    return returned(ax, axes)
