"""Attributes, and answers about an object, computed once.

Without the lock that functools.cached_property has until Python 3.12.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

__all__ = ["cached_property", "kept"]

Asked = TypeVar("Asked", bound=Callable[..., Any])

if TYPE_CHECKING or sys.version_info >= (3, 12):
    cached_property = functools.cached_property
else:

    class cached_property(functools.cached_property):
        """That of functools whose lock, one for all instances and threads, is never taken.

        A process that is forked while another thread holds that lock waits for it for ever. Two threads that
        ask at once may both compute; the first value is kept.
        """

        def __get__(self, instance: Any, owner: Any = None) -> Any:
            if instance is None:
                return self
            value = self.func(instance)
            return instance.__dict__.setdefault(self.attrname, value)


def kept(question: Asked) -> Asked:
    """A function of one object that is computed once: its answer stays with the object.

    Once for each choice of what it is asked beside.
    """
    name = f"_{question.__module__}.{question.__name__}"

    @functools.wraps(question)
    def answer(of: Any, *beside: Any) -> Any:
        own, key = of.__dict__, (name, *beside) if beside else name
        if key not in own:
            own[key] = question(of, *beside)
        return own[key]

    return answer  # type: ignore[return-value]
