"""Optional packages: loaded where they are used, with the cure where they are absent."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["optional"]


def optional(module: str, extra: str, purpose: str) -> Any:
    """Import an optional package.

    Parameters
    ----------
    module : str
        Dotted name of the module.
    extra : str
        Extra of modfun that installs it.
    purpose : str
        What needs it; the first words of the error message.

    Returns
    -------
    module

    Raises
    ------
    ImportError
        If the package is not installed; the message says how to install it.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as missing:
        root = module.partition(".")[0]
        if missing.name is not None and missing.name.partition(".")[0] != root:
            raise
        raise ImportError(f"{purpose} needs {root}: pip install 'modfun[{extra}]'") from None
