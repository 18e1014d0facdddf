"""Plots over frequency: Bode plots with bands, gains of reduced models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.arguments import shown
from ..base.axes import clip_to_lines, drawing, frequency_axis, returned, take_axes
from ..base.student import root
from ..errors import SpecError
from ..reduction.reduction import Reduction


@drawing
def bode(
    *systems: Any,
    band: tuple[float, float] | None = None,
    hz: bool = False,
    labels: Sequence[str] | None = None,
    ax: Any = None,
) -> Any:
    """Draw magnitude (dB) and phase (degrees) over frequency, fits with 95 % bands.

    Parameters
    ----------
    *systems : Fit, LTI or FrequencyResponse
        Every path of each gets a line; the band of a fit is by the delta method, and what lies outside
        the frequencies it was fitted on is dashed.
    band : (float, float), optional
        Frequencies drawn, rad/s; default: around the bands of the fits or the poles of the systems.
    hz : bool, default False
        Frequencies in hertz instead of rad/s.
    labels : sequence of str, optional
        A name a system, for the legend.
    ax : sequence of two Axes, optional
        Magnitude and phase; new ones by default.

    Returns
    -------
    ndarray of Axes
    """
    if not systems:
        raise SpecError("plot.bode: give at least one fit, system or frequency response")
    if labels is not None and len(labels) != len(systems):
        raise SpecError(f"plot.bode: {len(labels)} labels for {len(systems)} systems; give one each")
    for system in systems:
        if not any(hasattr(system, name) for name in ("omega0", "omega", "frequency_response")):
            raise SpecError(
                f"plot.bode: {shown(system)} is of type {type(system).__name__}; give a Fit, an LTI or a "
                "FrequencyResponse"
            )
    low, high = _range(systems) if band is None else band
    if not 0 < low < high:
        raise SpecError(f"plot.bode: band={band!r} must be (lower, upper) in rad/s with 0 < lower < upper")
    omega = np.geomspace(low, high, 400)
    upper, lower = take_axes(ax, 2, height=2.4)
    factor, label = frequency_axis(hz)
    color = 0
    drawn: dict[str, Any] = {}  # the phase of each path as first drawn
    for k, system in enumerate(systems):
        named = None if labels is None else labels[k]
        for name, w, gain, db_error, degrees_error, inside in _paths(system, omega):
            with np.errstate(divide="ignore"):
                db = 20 * np.log10(np.abs(gain))
            degrees = _turned(np.degrees(np.unwrap(np.angle(gain))), w, drawn, name)
            text = " ".join(part for part in (named, name) if part) or type(system).__name__
            for here, values, error in ((upper, db, db_error), (lower, degrees, degrees_error)):
                line = f"C{color % 10}"
                if error is not None:
                    here.fill_between(
                        factor * w, values - error, values + error, color=line, alpha=0.2, linewidth=0
                    )
                    here.plot(factor * w, values, color=line, linewidth=0.9, linestyle=(0, (4, 3)))
                here.plot(
                    factor * w,
                    np.where(inside, values, np.nan),
                    color=line,
                    linewidth=1.5,
                    label=text if here is upper else None,
                )
            color += 1
    for here in (upper, lower):
        here.set_xscale("log")
        here.grid(True, which="both", alpha=0.25)
        here.set_xlim(factor * low, factor * high)
    upper.set_ylabel("magnitude (dB)")
    lower.set_ylabel("phase (degrees)")
    lower.set_xlabel(label)
    clip_to_lines(upper)
    clip_to_lines(lower)
    above = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 4, "fontsize": "small"}
    upper.legend(frameon=False, **(above if color > 4 else {}))  # many names would hide the lines
    return returned(ax, [upper, lower])


@drawing
def reduction(red: Reduction, ax: Any = None, *, hz: bool = False) -> Any:
    """Draw the gains of a system, of its reduced model and of their difference over frequency.

    Parameters
    ----------
    red : Reduction
    ax : Axes, optional
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    Axes
        With several channels the largest gain over directions is drawn.
    """
    return red.plot(ax=ax, hz=hz)


def _range(systems: Sequence[Any]) -> tuple[float, float]:
    """Frequencies worth drawing, rad/s."""
    marks: list[float] = []
    for system in systems:
        if hasattr(system, "omega0"):
            low, high = system.band
            marks += [max(low, min(system.omega0, default=low)) / 2, 2 * high]
        elif hasattr(system, "omega"):
            marks += [float(w) for w in system.omega if w > 0]
        elif hasattr(system, "poles"):
            sizes = np.abs(system.poles())
            marks += [x for size in sizes[sizes > 0] for x in (size / 10, size * 10)]
    return (min(marks), max(marks)) if marks else (0.1, 10.0)


def _turned(degrees: Any, omega: Any, drawn: dict[str, Any], name: str) -> Any:
    """A phase on the branch, of all that differ by whole turns, that is nearest to the path's first one."""
    # A single path of one system may have no name.
    other = drawn.get(name) or (next(iter(drawn.values())) if len(drawn) == 1 else None)
    if other is None:
        drawn[name] = (omega, degrees)
        return degrees
    apart = np.interp(omega, *other) - degrees
    return degrees + 360 * np.round(np.median(apart[np.isfinite(apart)]) / 360) if apart.size else degrees


def _paths(system: Any, omega: Any) -> Any:
    """Yield name, frequencies, gain, errors in dB and degrees (or None), and which lie in the fitted band."""
    if hasattr(system, "omega0"):  # a fit
        outputs, inputs = len(system.outputs), len(system.inputs)
        response, gradient = system.frequency_response(omega)
        response = response.reshape(outputs, inputs, -1)
        gradient = gradient.reshape(-1, outputs, inputs, omega.size)
        cov = system.cov_params()
        inside = (omega >= system.band[0]) & (omega <= system.band[1])
        half = system.interval(np.zeros(omega.size), np.ones(omega.size))[1]
        for i, k in np.argwhere(np.any(response != 0, axis=2)):
            gain = response[i, k]
            with np.errstate(divide="ignore", invalid="ignore"):
                relative = gradient[:, i, k] / gain
            errors = [
                root(np.einsum("pf,pq,qf->f", part, cov, part)) for part in (relative.real, relative.imag)
            ]
            decibel, degree = 20 / np.log(10) * half * errors[0], np.degrees(half * errors[1])
            yield f"{system.inputs[k]} → {system.outputs[i]}", omega, gain, decibel, degree, inside
        return
    found = system if hasattr(system, "omega") else system.frequency_response(omega)
    everywhere = np.ones(found.omega.size, dtype=bool)
    several = found.response.shape[:2] != (1, 1)
    radius = found.radius()
    for i, row in enumerate(found.response):
        for k, gain in enumerate(row):
            name = f"{found.inputs[k]} → {found.outputs[i]}" if several else ""
            decibel = degree = None
            if radius is not None:
                with np.errstate(divide="ignore", invalid="ignore"):
                    relative = radius[i, k] / np.abs(gain)
                # Beyond the gain itself nothing is known of the angle.
                decibel = 20 / np.log(10) * relative
                degree = np.degrees(np.arcsin(np.minimum(relative, 1.0)))
            yield name, found.omega, gain, decibel, degree, everywhere
