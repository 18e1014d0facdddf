"""Numbers that have names: an array that also takes names as indices, and prints as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SpecError
from .names import nearest
from .tables import Table

__all__ = ["Named", "in_order"]


def in_order(what: str, values: ArrayLike | Mapping[str, float], names: Sequence[str]) -> ArrayLike:
    """Values of a mapping in the order of these names; what is no mapping as it is.

    Raises
    ------
    SpecError
        A name that is missing or unknown; `what` says who asks.
    """
    if not isinstance(values, Mapping):
        return values
    if lost := [name for name in (*names, *values) if name not in values or name not in names]:
        raise SpecError(f"{what}: {lost[0]!r}; the parameters are {', '.join(names)}")
    return [values[name] for name in names]


class Named(np.ndarray[Any, np.dtype[np.float64]]):
    """A vector, (p,), with a name for each number; whatever is computed from it is a plain array.

    Examples
    --------
    >>> vector = Named([2.91, 7.92], ["a1", "a2"])
    >>> float(vector["a2"]), vector[1:].tolist()
    (7.92, [7.92])
    >>> dict(vector)["a1"].item()
    2.91
    >>> vector
    parameter  value
    a1          2.91
    a2          7.92
    """

    # Of what is copied or cut, of which it is not known whether the names still hold.
    names: tuple[str, ...] = ()
    label: str = ""

    def __new__(cls, values: ArrayLike, names: Sequence[str], label: str = "value") -> Named:
        made = np.asarray(values, dtype=np.float64).view(cls)
        made.names, made.label = tuple(names), label
        return made

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return array[()] if np.ndim(array) == 0 else np.asarray(array)

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            if key not in self.names:
                raise SpecError(f"there is no parameter {key!r}; {nearest(key, self.names)}")
            key = self.names.index(key)
        return np.asarray(self)[key]

    def keys(self) -> tuple[str, ...]:
        """Names, so that ``dict(vector)`` and ``function(**vector)`` take it as a mapping."""
        return self.names

    def items(self) -> list[tuple[str, float]]:
        """Names with their numbers, as those of a dictionary."""
        return list(zip(self.names, self.tolist(), strict=True))

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def __contains__(self, key: object) -> bool:
        return key in self.names if isinstance(key, str) else super().__contains__(key)

    def __reduce__(self) -> Any:
        return Named, (np.asarray(self), self.names, self.label)

    def _table(self) -> Table:
        return Table({"parameter": list(self.names), self.label: np.asarray(self)})

    def __repr__(self) -> str:
        return repr(self._table()) if self.names else repr(np.asarray(self))

    def __str__(self) -> str:
        return repr(self) if self.names else str(np.asarray(self))

    def __format__(self, spec: str) -> str:
        return format(str(self), spec)

    def _repr_html_(self) -> str:
        return self._table()._repr_html_() if self.names else f"<pre>{self!r}</pre>"
