"""The reference holds every public name, once."""

import re
import types

import modfun as mf
from places import ROOT

REFERENCE = ROOT / "docs" / "reference"


def listed():
    """Names of the tables, and modules told on a page; without the leading `modfun.`."""
    names = []
    for page in sorted(REFERENCE.glob("*.rst")):
        text = page.read_text(encoding="utf-8")
        names += re.findall(r"^\.\. automodule:: modfun\.(\w+)$", text, re.MULTILINE)
        for table in re.findall(r"^\.\. autosummary::\n(?: +:.*\n)*\n((?: +.+\n)+)", text, re.MULTILINE):
            names += table.split()
    return names


def public():
    names = [name for name in mf.__all__ if not name.startswith("__")]
    for name in list(names):
        module = getattr(mf, name)
        if isinstance(module, types.ModuleType):
            names += [f"{name}.{inner}" for inner in module.__all__]
    return names


def test_every_public_name_is_in_the_reference_once():
    assert sorted(listed()) == sorted(public())


def test_every_page_is_in_its_contents():
    contents = (REFERENCE / "index.rst").read_text(encoding="utf-8")
    pages = {page.stem for page in REFERENCE.glob("*.rst")} - {"index"}
    assert set(re.findall(r"^   (\w+)$", contents, re.MULTILINE)) == pages
