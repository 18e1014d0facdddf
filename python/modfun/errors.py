"""Everything modfun raises or warns with, by who can put it right."""

__all__ = ["DataError", "FitError", "InternalError", "ModfunError", "ModfunWarning", "SpecError"]


class ModfunError(Exception):
    """Base class of all errors of modfun."""


class DataError(ModfunError, ValueError):
    """The samples do not allow what was asked; the message says which and what to change."""


class SpecError(ModfunError, ValueError):
    """A model, option or name that does not exist or does not fit; the message says what does."""


class FitError(ModfunError, RuntimeError):
    """Something needs a successful fit and this one was not."""


class InternalError(ModfunError, RuntimeError):
    """A defect of modfun itself; please report it with the text."""


class ModfunWarning(UserWarning):
    """The result is usable, but something about it deserves a look."""
