"""A page as HTML, in one file that loads nothing, and the way to disk: whole or not at all."""

from __future__ import annotations

import os
import re
from importlib.resources import files
from itertools import count
from pathlib import Path

from ..base.optional import optional
from ..base.writing import named, write_text
from ..errors import SpecError
from .parts import Page

__all__ = ["check_place", "render", "save"]

_ID = re.compile(r'(\bid="|href="#|url\(#)')


def render(page: Page) -> str:
    """The page as text.

    Raises
    ------
    ImportError
        jinja2 is not installed.
    """
    jinja2 = optional("jinja2", "report", "a report")
    here = files(__package__)
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    numbers = count(1)
    environment.filters["own_ids"] = lambda svg: _ID.sub(rf"\1f{next(numbers)}-", svg)
    template = environment.from_string(here.joinpath("page.html.j2").read_text(encoding="utf-8"))
    style = here.joinpath("style.css").read_text(encoding="utf-8")
    text: str = template.render(page=page, style=style)
    return text


def save(page: Page, path: str | os.PathLike[str], what: str) -> Path:
    """Write the page whole or not at all: what was there stays until all is written.

    Parameters
    ----------
    page : Page
    path : path
        Ends in .html or .htm.
    what : str
        The call, for messages.

    Returns
    -------
    Path
        Where it was written.

    Raises
    ------
    SpecError, ModfunError
        As `check_place` and `writing.write_text`.
    """
    place = check_place(path, what)
    write_text(what, place, render(page))
    return place


def check_place(path: str | os.PathLike[str], what: str) -> Path:
    """The place of a page, before the work of making it."""
    place = named(what, path)
    if place.suffix.lower() not in (".html", ".htm"):
        raise SpecError(f"{what}: {str(place)!r} is not the name of a page; end it in .html")
    if place.is_dir():
        raise SpecError(
            f"{what}: {str(place)!r} is a folder; name a file in it, as {str(place / 'fit.html')!r}"
        )
    if not place.parent.is_dir():
        raise SpecError(
            f"{what}: {str(place)!r} cannot be written: there is no folder {str(place.parent)!r}; make it "
            "first, or name another place"
        )
    return place
