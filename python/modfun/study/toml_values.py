"""Values of a study file: of what kind they are, which functions they name, what is said of wrong ones."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..base.arguments import shown
from ..base.callables import at
from ..base.names import nearest
from ..errors import SpecError

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
WORD = re.compile(r"""\s*(?:"([^"]*)"|'([^']*)'|([\w-]+))\s*""")  # of a dotted key


@dataclass(frozen=True)
class Key:
    """Where a value stands: file, names from the study's key down, the study's keys, the file's text."""

    file: str
    path: tuple[str, ...]
    keys: Collection[str]
    text: str

    @property
    def name(self) -> str:
        """The dotted name."""
        return ".".join(self.path)

    @property
    def place(self) -> str:
        """File and, as far as a look at the text can tell, line."""
        line = line_of(self.path, self.text)
        return self.file if line is None else f"{self.file}, line {line}"

    def below(self, name: str) -> Key:
        """A key of the table that stands here."""
        return replace(self, path=(*self.path, name))

    def refuse(self, text: str) -> SpecError:
        """An error that says where."""
        return SpecError(f"{self.place}: {self.name}{text}")

    def wrong(self, value: Any, expected: str) -> SpecError:
        """The error for a value of the wrong kind."""
        return self.refuse(f" = {shown(value)}; give {expected}{self._astray()}")

    def read(self, value: Mapping[str, Any], known: Mapping[str, Reader]) -> dict[str, Any]:
        """The values of a table with known keys."""
        for name in value:
            if name not in known:
                own, meant = self.below(name), nearest(name, list(known))
                raise SpecError(f"{own.place}: {self.name} has no key {name!r}; {meant}{own._astray()}")
        return {name: known[name](self.below(name), one) for name, one in value.items()}

    def _astray(self) -> str:
        """What stands below a header in brackets belongs to its table, which is easily forgotten."""
        *above, last = self.path
        if not above or last not in self.keys:
            return ""
        header = ".".join(above)
        return f" ({last} stands below [{header}]; if the study's is meant, put it above the first [...])"


def line_of(path: tuple[str, ...], text: str) -> int | None:
    """Line on which a key of a TOML text stands, or the braces that hold it.

    The text is only looked at: a value of several lines, each like a key, deceives it.
    """
    header: tuple[str, ...] = ()
    braces = None
    for number, line in enumerate(text.splitlines(), start=1):
        words, end = _dotted(line.lstrip(" \t["))
        if line.lstrip().startswith("["):
            header = own = words
        elif end == "=":
            own = header + words
            if braces is None and own == path[: len(own)]:
                braces = number
        else:
            continue
        if own[: len(path)] == path:  # it, or a table below it
            return number
    return braces


def _dotted(text: str) -> tuple[tuple[str, ...], str]:
    """The words of a dotted key at the beginning of a text, and the character behind."""
    words, at = [], 0
    while found := WORD.match(text, at):
        words.append(next(word for word in found.groups() if word is not None))
        at = found.end()
        if text[at : at + 1] != ".":
            break
        at += 1
    return tuple(words), text[at : at + 1]


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
