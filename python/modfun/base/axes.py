"""What every plot uses: Axes new or given, their labels, gaps of masked samples, units of frequency."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SpecError
from .arguments import Thing, public, shown
from .arrays import F64
from .names import nearest
from .optional import optional

SMALLEST = 7.0  # points of a label
GROWN = 1.15  # height of a panel after the layout over that before, at least


def drawing(function: Thing) -> Thing:
    """Decorate a function of `mf.plot`: what is of another kind than it draws is a SpecError."""
    return public(function, "plot.")


def take_axes(
    ax: Any, count: int, title: str, *, height: float = 2.4, width: float = 7.0, sharex: bool = True
) -> list[Any]:
    """Return `count` Axes: new ones below each other under a title, or the given one or ones."""
    if ax is None:
        pyplot = optional("matplotlib.pyplot", "plot", "plotting")
        size = (width, max(height * count, 2.6) + 0.5)
        figure, made = pyplot.subplots(
            count, 1, sharex=sharex, squeeze=False, figsize=size, layout="constrained"
        )
        figure.suptitle(title, fontsize="medium")
        return list(made[:, 0])
    if hasattr(ax, "plot"):
        return [ax] * count
    try:
        given = list(np.ravel(np.asarray(ax, dtype=object)))
    except Exception:  # of whatever the conversion of an unknown object raises
        given = [ax]
    if other := [one for one in given if not hasattr(one, "plot")]:
        raise SpecError(f"plot: ax holds {shown(other[0])}, which is not an Axes; give those of matplotlib")
    if len(given) != count:
        raise SpecError(f"plot: ax has {len(given)} Axes where {count} are needed, or a single one for all")
    return given


def take_pairs(
    ax: Any, outputs: int, title: str, *, height: float, sharex: bool = True
) -> list[tuple[Any, Any]]:
    """Return two Axes an output; a single Axes serves as both of a single output."""
    if outputs > 1 and hasattr(ax, "plot"):
        raise SpecError(
            f"plot: ax is a single Axes and there are {outputs} outputs; give {2 * outputs} Axes, or choose "
            "one output, as output="
        )
    axes = take_axes(ax, 2 * outputs, title, height=height, sharex=sharex)
    return list(zip(axes[::2], axes[1::2], strict=True))


def chosen_outputs(outputs: Sequence[str], output: str | None, what: str) -> list[int]:
    """Positions of the outputs to draw: the one that is named, or all."""
    if output is None:
        return list(range(len(outputs)))
    if output not in outputs:
        raise SpecError(f"{what}: the fit has no output {output!r}; {nearest(output, outputs)}")
    return [outputs.index(output)]


def chosen_rows(rows: Sequence[str], outputs: Sequence[str], output: str | None, what: str) -> list[int]:
    """Positions of the rows of residuals to draw: outputs or, of equations, these, which may be fewer."""
    if output is None:
        return list(range(len(rows)))
    if output in rows:
        return [rows.index(output)]
    if len(rows) != len(outputs):
        raise SpecError(f"{what}: residuals belong to equations; {nearest(output, rows)}")
    return chosen_outputs(outputs, output, what)


def take_grid(
    ax: Any, rows: int, columns: int, title: str, *, height: float = 3.1, sharex: bool = True
) -> list[Any]:
    """Return Axes row by row: new ones under a title, or the given ones."""
    if ax is not None:
        if hasattr(ax, "plot"):
            raise SpecError(f"plot: ax is a single Axes; give {rows * columns}")
        return take_axes(ax, rows * columns, title)
    pyplot = optional("matplotlib.pyplot", "plot", "plotting")
    figure, made = pyplot.subplots(
        rows,
        columns,
        sharex=sharex,
        squeeze=False,
        figsize=(4.6 * columns, height * rows + 0.5),
        layout="constrained",
    )
    figure.suptitle(title, fontsize="medium")
    return list(made.ravel())


def returned(ax: Any, axes: Sequence[Any]) -> Any:
    """Return what the caller sees: one Axes, or an array of them."""
    if len(axes) == 1 or hasattr(ax, "plot"):
        return axes[0]
    array = np.empty(len(axes), dtype=object)
    array[:] = axes
    return array


def name_y(here: Any, text: str) -> None:
    """Name the vertical axis; a name taller than its panel is set smaller and on several lines."""
    room = GROWN * here.figure.get_figheight() * here.get_position().height
    size = here.yaxis.label.get_size()
    if _length(text, size) > room:
        size = max(SMALLEST, 0.8 * size)
        text = _wrapped(text, max(int(room / _length("x", size)), 4))
    here.set_ylabel(text, fontsize=size)


def _length(text: str, size: float) -> float:
    """Inches of a text, about."""
    return 0.58 * size / 72 * max(len(text), 1)


def _wrapped(text: str, most: int) -> str:
    """A name in lines of so many letters, broken after blanks and underscores; a longer piece is cut."""
    lines = [""]
    for piece in re.split(r"(?<=[ _])", text):
        if lines[-1] and len(lines[-1]) + len(piece.rstrip()) > most:
            lines.append("")
        lines[-1] += piece
    return "\n".join(
        line.rstrip() if len(line.rstrip()) <= most else f"{line[: most - 1]}…" for line in lines
    )


def label_axes(axes: Sequence[Any], names: Sequence[str], units: dict[str, str], xlabel: str) -> None:
    """Name the axes: a channel each, or a legend where they share one."""
    if len(set(axes)) < len(axes):
        axes[0].legend()
    else:
        for name, here in zip(names, axes, strict=True):
            unit = units.get(name, "")
            name_y(here, f"{name} ({unit})" if unit and unit not in name else name)
    for here in axes:
        here.grid(True, alpha=0.3)
    axes[-1].set_xlabel(xlabel)


def bridge_gaps(here: Any, t: F64, values: F64, good: NDArray[np.bool_], label: str) -> None:
    """Dots from the good samples beside a gap across the masked ones, which the record filled in; shaded."""
    masked = ~good
    if masked.any():
        masked |= np.append(masked[1:], False) | np.insert(masked[:-1], 0, False)
        here.plot(t, np.where(masked, values, np.nan), ":", color="0.5", linewidth=1.0, label=label)
        across = here.get_xaxis_transform()
        here.fill_between(t, 0, 1, where=masked, transform=across, color="0.5", alpha=0.15, linewidth=0)


def frequency_axis(hz: bool) -> tuple[float, str]:
    """Return the factor from rad/s to the unit drawn, and the label of the axis."""
    return (0.5 / np.pi, "frequency (Hz)") if hz else (1.0, "frequency (rad/s)")


def decibels(size: Any) -> Any:
    return 20 * np.log10(np.maximum(size, 1e-300))


def clip_to_lines(axes: Any) -> None:
    """Scale an axis by its lines: an enormous confidence band must not flatten them."""
    lines = [np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()]
    values = np.concatenate(lines) if lines else np.empty(0)  # a gain of zero has no line
    values = values[np.isfinite(values)]
    if values.size:
        low, high = float(values.min()), float(values.max())
        room = 0.15 * (high - low) or 1.0
        axes.set_ylim(low - room, high + room)
