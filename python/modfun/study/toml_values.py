"""Values of a study file: of what kind they are, which functions they name, what is said of wrong ones."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from ..callables import at
from ..errors import SpecError
from ..tables import nearest

__all__ = [
    "Key",
    "Reader",
    "axis",
    "function",
    "imported",
    "is_a",
    "is_function",
    "numeric",
    "plain",
    "several",
    "table",
]

FUNCTION = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_][\w.]*")


@dataclass(frozen=True)
class Key:
    """Where a value stands: file, dotted name, and the keys of the study itself."""

    file: str
    name: str
    keys: Collection[str]

    def below(self, name: str) -> Key:
        """A key of the table that stands here."""
        return Key(self.file, f"{self.name}.{name}", self.keys)

    def refuse(self, text: str) -> SpecError:
        """An error that says where."""
        return SpecError(f"{self.file}: {self.name}{text}")

    def wrong(self, value: Any, expected: str) -> SpecError:
        """The error for a value of the wrong kind."""
        shown = repr(value)
        shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
        return self.refuse(f" = {shown}; give {expected}{self._astray()}")

    def read(self, value: Mapping[str, Any], known: Mapping[str, Reader]) -> dict[str, Any]:
        """The values of a table with known keys."""
        for name in value:
            if name not in known:
                astray = self.below(name)._astray()
                raise self.refuse(f" has no key {name!r}; {nearest(name, list(known))}{astray}")
        return {name: known[name](self.below(name), one) for name, one in value.items()}

    def _astray(self) -> str:
        """What stands below a header in brackets belongs to its table, which is easily forgotten."""
        header, _, last = self.name.rpartition(".")
        if not header or last not in self.keys:
            return ""
        return f" ({last} stands below [{header}]; if the study's is meant, put it above the first [...])"


Reader = Callable[[Key, Any], Any]


# Plain values ------------------------------------------------------------------------------------


def is_a(value: Any, *kinds: type) -> bool:
    """Whether it is of these kinds; true and false are no numbers."""
    return isinstance(value, kinds) and (bool in kinds or not isinstance(value, bool))


def numeric(value: Any) -> bool:
    """Whether it is a number, or lists of them however deep."""
    return all(map(numeric, value)) if isinstance(value, list) else is_a(value, int, float)


def plain(expected: str, *kinds: type) -> Reader:
    """A value of these kinds."""

    def read(key: Key, value: Any) -> Any:
        if not is_a(value, *kinds):
            raise key.wrong(value, expected)
        return value

    return read


def several(expected: str, *kinds: type) -> Reader:
    """A value of these kinds, or a list of them."""

    def read(key: Key, value: Any) -> Any:
        if not all(is_a(one, *kinds) for one in (value if isinstance(value, list) else [value])):
            raise key.wrong(value, expected)
        return value

    return read


# Functions ---------------------------------------------------------------------------------------


def is_function(value: Any) -> bool:
    """Whether it is a text such as "module:name"."""
    return isinstance(value, str) and FUNCTION.fullmatch(value) is not None


def imported(key: Key, place: str) -> Any:
    """What stands at "module:name"."""
    module, _, name = place.partition(":")
    try:
        found = importlib.import_module(module)
    except (Exception, SystemExit) as error:  # a script may leave at its end
        if isinstance(error, ModuleNotFoundError) and f"{module}.".startswith(f"{error.name}."):
            raise key.refuse(
                f" = {place!r}: there is no module {module} beside the study file, nor where Python looks"
            ) from None
        raise key.refuse(
            f" = {place!r}: {module} cannot be imported: {type(error).__name__}: {error}"
        ) from error
    try:
        return at(place)
    except AttributeError:
        own = [word for word in vars(found) if not word.startswith("_")]
        raise key.refuse(
            f" = {place!r}: {module} ({getattr(found, '__file__', 'built in')}) has no {name}; "
            f"{nearest(name, own)}"
        ) from None


def function(expected: str) -> Reader:
    """A function by its address."""

    def read(key: Key, value: Any) -> Any:
        if not is_function(value):
            raise key.wrong(value, f'{expected}, as "module:name"')
        found = imported(key, value)
        if not callable(found):
            raise key.refuse(f" = {value!r} is a {type(found).__name__}; give {expected}")
        return found

    return read


# Tables ------------------------------------------------------------------------------------------


def table(one: Reader, expected: str) -> Reader:
    """A table of names, each with such a value."""

    def read(key: Key, value: Any) -> Any:
        if not isinstance(value, dict):
            raise key.wrong(value, expected)
        return {name: one(key.below(name), inner) for name, inner in value.items()}

    return read


def axis(one: Reader) -> Reader:
    """Such a value, or a table of names for several: an axis of the study."""
    names = table(one, "")
    return lambda key, value: names(key, value) if isinstance(value, dict) else one(key, value)
