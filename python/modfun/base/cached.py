"""Attributes computed once, without the lock that functools.cached_property has until Python 3.12."""

from __future__ import annotations

import functools
import sys
from typing import TYPE_CHECKING, Any

__all__ = ["cached_property"]

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
