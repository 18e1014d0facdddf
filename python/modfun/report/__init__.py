"""Reports: one self-contained HTML page about a fit or a study. Needs the extra ``report``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from ..pages.page import check_place, save

if TYPE_CHECKING:
    from ..results.fit import Fit
    from ..study.results import Results

__all__ = ["write_fit", "write_study"]


def write_fit(
    fit: Fit, path: str | os.PathLike[str], *, title: str | None = None, command: str | None = None
) -> Path:
    """Write the report of a fit; see `Fit.report`."""
    from ..results.page import page_of

    check_place(path, "report")
    return save(page_of(fit, title, command), path, "report")


def write_study(
    results: Results,
    path: str | os.PathLike[str],
    *,
    directory: str | os.PathLike[str] | None = None,
    title: str | None = None,
) -> Path:
    """Write the report of a study; see `Results.report`."""
    from ..study.page import page_of

    check_place(path, "report")
    return save(page_of(results, directory, title), path, "report")
