"""Bode plots by gains: magnitude and phase of paths over frequency, with errors where they are known."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.axes import clip_to_lines, frequency_axis, returned, take_axes, take_grid
from ..errors import SpecError

__all__ = ["Curve", "curves_of", "draw_bode", "draw_bode_grid", "draw_levels", "span"]

LOWEST = 8  # one in so many of the points of a phase, the lowest, tells its branch
SURE, SURELY = 2.0, 45.0  # the branch is told by points whose error is so often the least, or so many degrees


@dataclass(frozen=True, eq=False)
class Curve:
    """Gain of a path over frequency; half-widths of its bands (None: not known) and where it was fitted."""

    path: str
    omega: F64
    gain: C128
    decibels: F64 | None = None
    degrees: F64 | None = None
    inside: Any = True
    place: tuple[int, int] = (0, 0)  # output, input


def curves_of(
    omega: F64, response: C128, radius: F64 | None, outputs: Sequence[str], inputs: Sequence[str]
) -> list[Curve]:
    """The paths of a response (output, input, omega), with circles of this radius where it is known."""
    several, found = response.shape[:2] != (1, 1), []
    for i, k in np.ndindex(response.shape[:2]):
        gain, decibels, degrees = response[i, k], None, None
        if radius is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                relative = radius[i, k] / np.abs(gain)
            # Beyond the gain itself nothing is known of the angle.
            decibels = 20 / np.log(10) * relative
            degrees = np.degrees(np.arcsin(np.minimum(relative, 1.0)))
        path = f"{inputs[k]} → {outputs[i]}" if several else ""
        found.append(Curve(path, omega, gain, decibels, degrees, place=(i, k)))
    return found


def span(marks: Iterable[float], band: tuple[float, float] | None = None) -> tuple[float, float]:
    """Lowest and highest frequency to draw: the band given, or around what marks worth seeing.

    Raises
    ------
    SpecError
        No band of positive frequencies.
    """
    worth = list(marks) or [0.1, 10.0]
    low, high = (min(worth), max(worth)) if band is None else band
    if not 0 < low < high:
        raise SpecError(f"plot: band={band!r} must be (lower, upper) in rad/s with 0 < lower < upper")
    return low, high


def draw_bode(
    curves: Iterable[tuple[str, Curve]], low: float, high: float, *, hz: bool = False, ax: Any = None
) -> Any:
    """Draw curves, each under a label, between two frequencies; see `modfun.plot.bode`."""
    if hasattr(ax, "plot"):
        raise SpecError("plot.bode: ax is a single Axes; give two, for magnitude and phase")
    upper, lower = take_axes(ax, 2, "Bode plot", height=2.4)
    factor, label = frequency_axis(hz)
    drawn: dict[str, Any] = {}  # the phase of each path as first drawn
    color = 0
    for text, curve in curves:
        with np.errstate(divide="ignore"):
            db = 20 * np.log10(np.abs(curve.gain))
        turns = np.degrees(np.unwrap(np.angle(curve.gain)))
        phase = _turned(turns, curve, drawn)
        w, line = factor * curve.omega, f"C{color % 10}"
        for here, values, error in ((upper, db, curve.decibels), (lower, phase, curve.degrees)):
            if error is not None:
                here.fill_between(w, values - error, values + error, color=line, alpha=0.2, linewidth=0)
                here.plot(w, values, color=line, linewidth=0.9, linestyle=(0, (4, 3)))
            here.plot(
                w,
                np.where(curve.inside, values, np.nan),
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


def draw_bode_grid(
    curves: Sequence[tuple[str, Curve]], low: float, high: float, *, hz: bool = False, ax: Any = None
) -> Any:
    """Draw each path in panels of its own: outputs below each other, inputs side by side."""
    outputs, inputs = (1 + max(curve.place[k] for _, curve in curves) for k in range(2))
    axes = np.array(take_grid(ax, 2 * outputs, inputs, "Bode plot", height=2.2), dtype=object)
    panels = axes.reshape(2 * outputs, inputs)
    for i, k in np.ndindex(outputs, inputs):
        own = [(text, one) for text, one in curves if one.place == (i, k) and np.any(one.gain != 0)]
        upper, lower = panels[2 * i, k], panels[2 * i + 1, k]
        if not own:
            upper.set_title("no path", fontsize="medium")
            continue
        draw_bode(own, low, high, hz=hz, ax=[upper, lower])
        upper.set_title(own[0][1].path, fontsize="medium")
        if (i, k) != (0, 0) or len(own) < 2:
            upper.get_legend().remove()
        if i < outputs - 1:
            lower.set_xlabel("")
    return panels


def draw_levels(upper: Any, omega: F64, levels: Mapping[str, tuple[F64, str]], *, hz: bool = False) -> None:
    """Mark levels (output, input, omega), each with its marker, under the gains of `draw_bode`."""
    factor, _ = frequency_axis(hz)
    for name, (level, marker) in levels.items():
        for path, own in enumerate(level.reshape(-1, omega.size)):
            seen = own > 0
            upper.plot(
                factor * omega[seen],
                20 * np.log10(own[seen]),
                marker,
                color=f"C{path % 10}",
                markersize=4,
                label=None if path else name,
            )
    clip_to_lines(upper)
    upper.legend(frameon=False, fontsize="small", loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4)


def _turned(degrees: Any, curve: Curve, drawn: dict[str, Any]) -> Any:
    """A phase on the branch, of all that differ by whole turns, that is nearest to the path's first one."""
    # A single path of one system may have no name.
    other = drawn.get(curve.path) or (next(iter(drawn.values())) if len(drawn) == 1 else None)
    if other is None:
        drawn[curve.path] = (curve.omega, degrees)
        return degrees
    apart = np.interp(curve.omega, *other) - degrees
    known = np.isfinite(apart)
    # Where noise hides the gain, its phase wanders by whole turns.
    if curve.degrees is not None and np.isfinite(curve.degrees).any():
        known &= curve.degrees <= max(SURE * np.nanmin(curve.degrees), SURELY)
    # At the lowest of them: higher up a delay turns one of two phases away from the other.
    lowest = apart[known][: max(1, int(known.sum()) // LOWEST)]
    return degrees + 360 * np.round(np.median(lowest) / 360) if lowest.size else degrees
