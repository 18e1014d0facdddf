"""Plots of systems and fits in time and in the complex plane: step, impulse and Nyquist, with 95 % bands."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ..base.arguments import shown
from ..base.arrays import F64
from ..base.axes import drawing, returned, take_axes, take_grid
from ..base.student import root
from ..errors import SpecError
from ..models.transfer_function import system_of
from ..systems.drawing import span
from ..systems.lti import LTI
from ..systems.making import linear
from .drawing import word_of
from .estimates import Estimates as Fit
from .gradients import differences

__all__ = ["impulse", "nyquist", "step"]

POINTS = 400
SETTLED = 6.0  # time constants of the slowest mode that a response shows
FINE = 2000  # frequencies of a Nyquist curve
REGIONS = 24  # confidence regions along a Nyquist curve


@drawing
def step(
    *systems: Any, duration: float | None = None, labels: Sequence[str] | None = None, ax: Any = None
) -> Any:
    """Draw step responses, one panel per path, those of fits with 95 % bands by the delta method.

    Parameters
    ----------
    *systems : Fit or LTI, or systems of python-control or SciPy
        With the same numbers of outputs and inputs.
    duration : float, optional
        Time drawn in seconds; default: until the slowest mode has settled.
    labels : sequence of str, optional
        A name per system, for the legend.
    ax : Axes or sequence of Axes, optional
        One per path, output by output; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one path.

    See Also
    --------
    modfun.LTI.step : What is drawn.
    modfun.plot.impulse : Impulse responses.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> ax = mf.plot.step(mf.tf([5], [1, 3, 8]))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('time (s)', 'step response')
    """
    return _in_time("step", LTI.step, systems, duration, labels, ax)


@drawing
def impulse(
    *systems: Any, duration: float | None = None, labels: Sequence[str] | None = None, ax: Any = None
) -> Any:
    """Draw impulse responses, one panel per path, those of fits with 95 % bands by the delta method.

    Parameters
    ----------
    *systems : Fit or LTI, or systems of python-control or SciPy
        With the same numbers of outputs and inputs.
    duration : float, optional
        Time drawn in seconds; default: until the slowest mode has settled.
    labels : sequence of str, optional
        A name per system, for the legend.
    ax : Axes or sequence of Axes, optional
        One per path, output by output; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one path.

    See Also
    --------
    modfun.LTI.impulse : What is drawn.
    modfun.plot.step : Step responses.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> ax = mf.plot.impulse(mf.tf([5], [1, 3, 8]))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('time (s)', 'impulse response')
    """
    return _in_time("impulse", LTI.impulse, systems, duration, labels, ax)


@drawing
def nyquist(
    *systems: Any,
    band: tuple[float, float] | None = None,
    labels: Sequence[str] | None = None,
    ax: Any = None,
) -> Any:
    """Draw frequency responses in the complex plane, one panel per path, those of fits with 95 % regions.

    The cross is the point −1. Dashed lines are those of negative frequencies.

    Parameters
    ----------
    *systems : Fit or LTI, or systems of python-control or SciPy
        With the same numbers of outputs and inputs.
    band : (float, float), optional
        Frequencies drawn, rad/s; default: a hundredth of the slowest pole to a hundred times the fastest.
    labels : sequence of str, optional
        A name per system, for the legend.
    ax : Axes or sequence of Axes, optional
        One per path, output by output; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one path.

    See Also
    --------
    modfun.plot.bode : Magnitude and phase over frequency.

    References
    ----------
    H. Nyquist, Regeneration theory, Bell Syst. Tech. J. 11, 1932.

    Examples
    --------
    >>> import modfun as mf
    >>> ax = mf.plot.nyquist(mf.tf([5], [1, 3, 8]))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('real part', 'imaginary part')
    """
    known = _known(systems, "nyquist", labels)
    sizes = [float(s) for _, own, _ in known for s in np.abs(own.poles()) if s > 0]
    low, high = span([x for size in sizes for x in (size / 100, size * 100)], band)
    omega = np.geomspace(low, high, FINE)
    axes = _panels(ax, known[0][1].shape, "Nyquist plot", sharex=False)
    for k, (label, own, fit) in enumerate(known):
        gain = own.frequency_response(omega).response
        for here, path in zip(axes, np.ndindex(own.shape), strict=True):
            z, color = gain[path], f"C{k % 10}"
            here.plot(z.real, z.imag, color=color, linewidth=1.4, label=label)
            here.plot(z.real, -z.imag, color=color, linewidth=0.9, linestyle=(0, (4, 3)))
            if fit is not None:
                along = np.cumsum(np.abs(np.diff(z, prepend=z[:1])))
                at = np.searchsorted(along, np.linspace(0.0, along[-1], REGIONS, endpoint=False))
                for edge in _regions(fit, omega[np.unique(at)], path):
                    here.fill(edge[0], edge[1], color=color, alpha=0.2, linewidth=0)
    for here in axes:
        here.plot([-1], [0], "+", color="0.2", markersize=9)
        here.set_aspect("equal", adjustable="datalim")
    return _ended(ax, axes, known, "real part", "imaginary part")


# What they share ----------------------------------------------------------------------------------

Known = tuple[str, LTI, Fit | None]


def _known(systems: Sequence[Any], what: str, labels: Sequence[str] | None) -> list[Known]:
    """Label, system and fit (None where it is none) of each."""
    if not systems:
        raise SpecError(f"plot.{what}: give at least one fit or system")
    if labels is not None and len(labels) != len(systems):
        raise SpecError(f"plot.{what}: {len(labels)} labels for {len(systems)} systems; give one each")
    found: list[Known] = []
    for k, given in enumerate(systems):
        fit = given if isinstance(given, Fit) else None
        own = given.model if fit is not None else linear(given, f"plot.{what}")
        if not isinstance(own, LTI) or 0 in own.shape:
            raise SpecError(
                f"plot.{what}: {shown(given)} is not a linear system with inputs; give a Fit or an LTI"
            )
        if found and own.shape != found[0][1].shape:
            raise SpecError(
                f"plot.{what}: the systems have {found[0][1].shape} and {own.shape} outputs and inputs; draw "
                "those of one size together"
            )
        word = word_of(given) if len(systems) > 1 else type(given).__name__
        found.append((labels[k] if labels is not None else word, own, fit))
    return found


def _in_time(
    what: str,
    response: Callable[..., Any],
    systems: Sequence[Any],
    duration: float | None,
    labels: Sequence[str] | None,
    ax: Any,
) -> Any:
    known = _known(systems, what, labels)
    length = max(_settling(own) for _, own, _ in known) if duration is None else duration
    axes = _panels(ax, known[0][1].shape, f"{what.capitalize()} response")
    for k, (label, own, fit) in enumerate(known):

        def of(system: LTI) -> F64:
            return np.reshape(response(system, length, POINTS)[1], (*system.shape, POINTS + 1))

        t, values = response(own, length, POINTS)[0], of(own)
        half = None if fit is None else _half(fit, of)
        for here, path in zip(axes, np.ndindex(own.shape), strict=True):
            if half is not None:
                low, high = values[path] - half[path], values[path] + half[path]
                here.fill_between(t, low, high, color=f"C{k % 10}", alpha=0.2, linewidth=0)
            here.plot(t, values[path], color=f"C{k % 10}", linewidth=1.4, label=label)
    return _ended(ax, axes, known, "time (s)", f"{what} response")


def _settling(system: LTI) -> float:
    """Seconds until the slowest mode has settled; of one that does not settle some periods of it."""
    poles = system.poles()
    rates = np.maximum(np.abs(poles.real), 0.02 * np.abs(poles))
    slowest = float(np.min(rates[rates > 0], initial=np.inf))
    late = float(np.max(system.path_delays, initial=0.0))
    return late + (SETTLED / slowest if np.isfinite(slowest) else 1.0 + late)


def _half(fit: Fit, of: Callable[[LTI], F64]) -> F64:
    """Half-widths of the 95 % band of what a function makes of the model."""
    if fit.layout.rational:
        slopes = differences(lambda params: of(system_of(fit.layout, params)), fit.params[:], fit.bse[:])
    else:
        _, slopes = fit._gradient(of)  # type: ignore[attr-defined]
    error = root(np.einsum("p...,pq,q...->...", slopes, fit.cov_params(), slopes))
    return np.asarray(fit.interval(np.zeros_like(error), error)[1])


def _regions(fit: Fit, omega: F64, path: tuple[int, ...]) -> Iterator[F64]:
    """Edges (2, point) of the 95 % regions of the gains of a path."""
    from scipy.special import fdtri

    turn = np.exp(2j * np.pi * np.arange(61) / 60)
    response, gradient = fit.response_gradients(omega)
    (i, j), cov = path, fit.cov_params()
    for f in range(omega.size):
        z, own = response[i, j, f], gradient[:, i, j, f]
        both = np.array([own.real, own.imag])
        spread = both @ cov @ both.T
        if np.all(np.isfinite(spread)):
            size, axes = np.linalg.eigh(spread)
            radius = np.sqrt(2 * fdtri(2, max(fit.df_resid, 1), 0.95) * np.maximum(size, 0.0))
            edge = axes @ (radius[:, None] * np.array([turn.real, turn.imag]))
            yield edge + np.array([[z.real], [z.imag]])


def _panels(ax: Any, shape: tuple[int, int], title: str, sharex: bool = True) -> list[Any]:
    if shape == (1, 1):
        return take_axes(ax, 1, title, height=3.4, width=6.0)
    return take_grid(ax, *shape, title, sharex=sharex)


def _ended(ax: Any, axes: list[Any], known: list[Known], xlabel: str, ylabel: str) -> Any:
    system = known[0][1]
    outputs, inputs = system.shape
    for here, (i, j) in zip(axes, np.ndindex(system.shape), strict=True):
        here.grid(True, alpha=0.3)
        if i == outputs - 1:
            here.set_xlabel(xlabel)
        if j == 0:
            here.set_ylabel(ylabel)
        if len(axes) > 1:
            names = system.inputs or [f"u{k + 1}" for k in range(inputs)]
            others = system.outputs or [f"y{k + 1}" for k in range(outputs)]
            here.set_title(f"{names[j]} → {others[i]}", fontsize="medium")
    if len(known) > 1:
        axes[0].legend(frameon=False, fontsize="small")
    return returned(ax, axes)
