"""Units of measured channels, and what one is in another: angles, rates, lengths, speeds, forces, ..."""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass
from functools import cache
from typing import Any

from ..errors import SpecError
from .names import nearest
from .optional import optional

__all__ = ["TIMES", "Scale", "angle_of", "any_scale", "counted_in", "scale", "seconds_in"]

# Seconds in each unit of time, and its other spellings.
TIMES: dict[str, tuple[float, tuple[str, ...]]] = {
    "s": (1.0, ("sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden")),
    "ms": (1e-3, ("msec", "msecs", "millis", "millisecond", "milliseconds", "millisekunden")),
    "us": (1e-6, ("µs", "μs", "usec", "µsec", "μsec", "microsecond", "microseconds", "mikrosekunden")),
    "ns": (1e-9, ("nsec", "nanosecond", "nanoseconds", "nanosekunden")),
    "min": (60.0, ("mins", "minute", "minutes", "minuten")),
    "h": (3600.0, ("hr", "hrs", "hour", "hours", "std", "stunde", "stunden")),
    "d": (86400.0, ("day", "days", "tag", "tage")),
    "week": (604800.0, ("weeks", "woche", "wochen")),
}
_SPELLED = {word: name for name, (_, words) in TIMES.items() for word in (name, *words)}

# Steps from which on whole numbers without a unit are likelier in it.
COUNTED = (("ns", 5e6), ("us", 1e3), ("ms", 2.0))

# Size of each unit in rad, m, kg, s, K, A, and its powers of these (a: angle).
_BASE: dict[str, tuple[float, dict[str, int]]] = {
    "rad": (1.0, {"a": 1}), "deg": (math.pi / 180, {"a": 1}), "rev": (2 * math.pi, {"a": 1}),
    "arcmin": (math.pi / 10800, {"a": 1}), "arcsec": (math.pi / 648000, {"a": 1}),
    **{name: (seconds, {"s": 1}) for name, (seconds, _) in TIMES.items()},
    "Hz": (2 * math.pi, {"a": 1, "s": -1}), "rpm": (math.pi / 30, {"a": 1, "s": -1}),
    "m": (1.0, {"m": 1}), "mm": (1e-3, {"m": 1}), "cm": (1e-2, {"m": 1}), "km": (1e3, {"m": 1}),
    "ft": (0.3048, {"m": 1}), "in": (0.0254, {"m": 1}), "mile": (1609.344, {"m": 1}),
    "nmi": (1852.0, {"m": 1}), "kn": (1852 / 3600, {"m": 1, "s": -1}), "mph": (0.44704, {"m": 1, "s": -1}),
    "fps": (0.3048, {"m": 1, "s": -1}), "fpm": (0.00508, {"m": 1, "s": -1}),
    "kph": (1 / 3.6, {"m": 1, "s": -1}),
    "g": (9.80665, {"m": 1, "s": -2}),
    "kg": (1.0, {"kg": 1}), "t": (1e3, {"kg": 1}), "lb": (0.45359237, {"kg": 1}),
    "slug": (14.593902937206364, {"kg": 1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}), "kN": (1e3, {"kg": 1, "m": 1, "s": -2}),
    "lbf": (4.4482216152605, {"kg": 1, "m": 1, "s": -2}),
    "Nm": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}), "kW": (1e3, {"kg": 1, "m": 2, "s": -3}),
    "hp": (745.6998715822702, {"kg": 1, "m": 2, "s": -3}),
    "Pa": (1.0, {"kg": 1, "m": -1, "s": -2}), "hPa": (100.0, {"kg": 1, "m": -1, "s": -2}),
    "kPa": (1e3, {"kg": 1, "m": -1, "s": -2}), "mbar": (100.0, {"kg": 1, "m": -1, "s": -2}),
    "bar": (1e5, {"kg": 1, "m": -1, "s": -2}), "psi": (6894.757293168361, {"kg": 1, "m": -1, "s": -2}),
    "psf": (47.88025898033584, {"kg": 1, "m": -1, "s": -2}),
    "inHg": (3386.389, {"kg": 1, "m": -1, "s": -2}),
    "V": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}), "mV": (1e-3, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "A": (1.0, {"A": 1}), "mA": (1e-3, {"A": 1}),
    "K": (1.0, {"K": 1}), "%": (0.01, {}), "1": (1.0, {}),
}  # fmt: skip
_ALIKE = {
    "°": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad", "revolution": "rev",
    **_SPELLED, **{word.capitalize(): name for word, name in _SPELLED.items() if len(word) > 2}, "hz": "Hz",
    "meter": "m", "metre": "m", "meters": "m", "metres": "m", "feet": "ft", "foot": "ft", "inch": "in",
    "kt": "kn", "kts": "kn", "knot": "kn", "knots": "kn", "KTAS": "kn", "KIAS": "kn", "kmh": "kph", "G": "g",
    "lbs": "lb", "degC": "°C", "degF": "°F", "C": "°C", "F": "°F", "percent": "%", "-": "1", "": "1",
}  # fmt: skip
_POINTS = {"°C": (1.0, 273.15), "°F": (5 / 9, 459.67 * 5 / 9)}  # K: factor, and that of zero
_PART = re.compile(r"([*/·\s])?\s*([^\d\s*/·^()²³]+|1)(?:(?:\^|\*\*)?(-?\d)|([²³]))?")


def counted_in(step: float) -> str | None:
    """The unit smaller than a second that steps of whole numbers may have; None where these are seconds.

    Examples
    --------
    >>> counted_in(20.0), counted_in(10_000.0), counted_in(60.0)
    ('ms', 'us', None)
    """
    minutes = step in (60, 120, 300, 600, 900, 1800, 3600)
    return None if minutes else next((unit for unit, least in COUNTED if step >= least), None)


@dataclass(frozen=True)
class Scale:
    """A conversion: new value = factor · value + offset."""

    factor: float
    offset: float = 0.0


def scale(what: str, old: str, new: str) -> Scale:
    """The conversion from one unit to another.

    Parameters
    ----------
    what : str
        Begins the message.
    old, new : str
        Such as ``"deg/s"``, ``"ft/s^2"``, ``"kt"``, ``"°C"``.

    Raises
    ------
    SpecError
        A unit that is not known, or units of different kinds.

    Examples
    --------
    >>> scale("example", "kt", "m/s")
    Scale(factor=0.5144444444444445, offset=0.0)
    >>> scale("example", "°F", "°C").factor * 212 + scale("example", "°F", "°C").offset
    100.0
    """
    (size, kind, zero), (other, wanted, origin) = _read(what, old), _read(what, new)
    if kind != wanted:
        raise SpecError(_differ(what, old, new))
    return Scale(size / other, round((zero - origin) / other, 12))


def any_scale(what: str, old: str, new: str) -> Scale:
    """As `scale`; units that are not in its table are asked of pint, where that is installed.

    Raises
    ------
    SpecError
        A unit that neither knows, or units of different kinds.

    Examples
    --------
    >>> any_scale("example", "kt", "m/s")
    Scale(factor=0.5144444444444445, offset=0.0)
    """
    try:
        return scale(what, old, new)
    except SpecError as unknown:
        try:
            given = [_pint().Quantity(value, old) for value in (0.0, 1.0)]
            if given[0].is_compatible_with(new):
                zero, one = (value.to(new).magnitude for value in given)
                return Scale(one - zero, zero)
        except ImportError as missing:
            raise SpecError(f"{unknown} ({missing})") from None
        except Exception:  # of pint and of the parsers below it, for what is not a unit
            raise unknown from None
        raise SpecError(_differ(what, old, new)) from None


def seconds_in(unit: str) -> float | None:
    """How many seconds a unit of time is, in any spelling; None of what is no such unit.

    Examples
    --------
    >>> seconds_in("Minuten"), seconds_in("hrs"), seconds_in("days since 2026-03-01"), seconds_in("foo")
    (60.0, 3600.0, 86400.0, None)
    """
    name = _SPELLED.get(unit.lower().partition(" since ")[0].strip(" ."))
    return None if name is None else TIMES[name][0]


def _differ(what: str, old: str, new: str) -> str:
    return f"{what}: {old} and {new} differ in kind; give a unit that {old} can become"


@cache
def _pint() -> Any:
    return optional("pint", "units", "any other unit").UnitRegistry(autoconvert_offset_to_baseunit=True)


def angle_of(text: str) -> str:
    """The unit of angle in a unit, such as "deg" in "deg/s"; empty where there is none."""
    parts = (_ALIKE.get(part[2], part[2]) for part in _PART.finditer(text.strip()))
    return next((part for part in parts if _BASE.get(part, (0, {}))[1] == {"a": 1}), "")


def _read(what: str, text: str) -> tuple[float, Counter[str], float]:
    """Size of a unit in base units, its powers of these, and its zero in them."""
    name = text.strip()
    name = _ALIKE.get(name, name)
    if name in _POINTS:
        factor, zero = _POINTS[name]
        return factor, Counter({"K": 1}), zero
    size, kind, at = 1.0, Counter[str](), 0
    while at < len(name):
        part = _PART.match(name, at)
        symbol = "" if part is None else _ALIKE.get(part[2], part[2])
        if part is None or symbol not in _BASE:
            known = [*_BASE, *_POINTS]
            raise SpecError(f"{what}: the unit {text!r} is not known; {nearest(symbol or text, known)}")
        power = int(part[3]) if part[3] else {"²": 2, "³": 3}.get(part[4], 1)
        power = -power if part[1] == "/" else power
        factor, own = _BASE[symbol]
        size *= factor**power
        kind.update({dimension: power * exponent for dimension, exponent in own.items()})
        at = part.end()
    return size, Counter({dimension: power for dimension, power in kind.items() if power}), 0.0
