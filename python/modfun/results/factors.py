"""Factors of channels: those of units, and of a sign."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

from .hidden_units import DEGREES, GRAVITY

__all__ = ["OF_ANGLES", "OF_FORCES", "ROUGH", "UNITS", "Unit", "turned", "unit_of"]

ROUGH = 0.05  # relative: kinematics are often rounded
NEAR = 0.03  # relative: how near a factor is that of a unit
# What a factor of a channel is, as size and words.
Unit = tuple[float, str]
UNITS: tuple[Unit, ...] = (
    (DEGREES, "in degrees and not in radians"),
    (1 / DEGREES, "in radians and not in degrees"),
    (1 / GRAVITY, "in g and not in m/s²"),
    (GRAVITY, "in m/s² and not in g"),
    (1 / 0.3048, "in feet and not in metres"),
    (0.3048, "in metres and not in feet"),
    (1 / 0.5144, "in knots and not in m/s"),
    (0.5144, "in m/s and not in knots, or in m/s² beside a speed in knots"),
)
OF_FORCES = (*UNITS[2:6], UNITS[7])  # what accelerations may be in
OF_ANGLES = UNITS[:2]  # the same of channels whose unit is an angle, or one of rates of turn


def turned(factor: float) -> bool:
    """Whether a factor is that of a sign."""
    return abs(factor + 1) < ROUGH


def unit_of(factor: float, units: Sequence[Unit] = UNITS) -> Unit | None:
    """The size and words of a unit."""
    # Knots are close to two or a half, which are no unit: such a factor is that of a time step, say.
    near = {size: min(NEAR, abs(log(size / 2)) / 2, abs(log(size * 2)) / 2) for size, _ in units}
    return next((unit for unit in units if abs(log(abs(factor) / unit[0])) < near[unit[0]]), None)
