"""Everything modfun raises or warns with, by who can put it right."""

__all__ = ["DataError", "FitError", "InternalError", "ModfunError", "ModfunWarning", "SpecError"]


class ModfunError(Exception):
    """Base class of all errors of modfun.

    See Also
    --------
    modfun.DataError : Samples that cannot be used.
    modfun.SpecError : An option or a structure that cannot be used.

    References
    ----------
    The guide docs/faults.md.

    Examples
    --------
    >>> import modfun as mf
    >>> issubclass(mf.DataError, mf.ModfunError)
    True
    """


class DataError(ModfunError, ValueError):
    """The samples do not allow what was asked; the message says which and what to change.

    See Also
    --------
    modfun.SpecError : An option or a structure that cannot be used.
    modfun.FitError : A number that a failed fit does not have.

    References
    ----------
    The guide docs/faults.md.

    Examples
    --------
    >>> import modfun as mf
    >>> try:
    ...     mf.Record(y=[0.0, float("nan"), 1.0], dt=0.1)
    ... except mf.DataError as error:
    ...     print(type(error).__name__)
    DataError
    """


class SpecError(ModfunError, ValueError):
    """A model, option or name that does not exist or does not fit; the message says what does.

    See Also
    --------
    modfun.DataError : Samples that cannot be used.
    modfun.FitError : A number that a failed fit does not have.

    References
    ----------
    The guide docs/faults.md.

    Examples
    --------
    >>> import modfun as mf
    >>> try:
    ...     mf.TransferFunction(poles=0)
    ... except mf.SpecError as error:
    ...     print(type(error).__name__)
    SpecError
    """


class FitError(ModfunError, RuntimeError):
    """Something needs a successful fit and this one was not.

    See Also
    --------
    modfun.DataError : Samples that cannot be used.
    modfun.SpecError : An option or a structure that cannot be used.

    References
    ----------
    The guide docs/faults.md.

    Examples
    --------
    >>> import modfun as mf
    >>> issubclass(mf.FitError, mf.ModfunError)
    True
    """


class InternalError(ModfunError, RuntimeError):
    """A defect of modfun itself; please report it with the text.

    See Also
    --------
    modfun.DataError : Samples that cannot be used.
    modfun.SpecError : An option or a structure that cannot be used.

    References
    ----------
    The guide docs/faults.md.

    Examples
    --------
    >>> import modfun as mf
    >>> issubclass(mf.InternalError, mf.ModfunError)
    True
    """


class ModfunWarning(UserWarning):
    """The result is usable, but something about it deserves a look.

    See Also
    --------
    modfun.DataError : Samples that cannot be used.
    modfun.SpecError : An option or a structure that cannot be used.

    References
    ----------
    The guide docs/faults.md.

    Examples
    --------
    >>> import warnings
    >>> import modfun as mf
    >>> warnings.simplefilter("error", mf.ModfunWarning)  # stop at the first doubtful fit
    >>> issubclass(mf.ModfunWarning, UserWarning)
    True
    """
