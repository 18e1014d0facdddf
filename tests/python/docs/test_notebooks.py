"""Notebooks of pages: their cells are the page's blocks, in order, without links that lead nowhere."""

import importlib.util
import json
import re

import pytest
from places import ROOT


def module(path):
    """A file of docs/ as a module; sphinx is not needed to read it."""
    text = path.read_text(encoding="utf-8").replace(
        "from sphinx.application import Sphinx\n", "Sphinx = object\n"
    )
    made = importlib.util.module_from_spec(importlib.util.spec_from_loader(path.stem, None))
    exec(compile(text, path, "exec"), made.__dict__)
    return made


PAGES = module(ROOT / "docs" / "_extensions" / "pages.py")
OFFERED = re.findall(
    r'"([\w/]+)"',
    re.search(r"^notebooks = \[(.*?)\]", (ROOT / "docs/conf.py").read_text(encoding="utf-8"), re.S | re.M)[1],
)


def test_five_pages_are_offered():
    assert len(OFFERED) == 5


@pytest.mark.parametrize("page", OFFERED)
def test_the_cells_of_a_notebook_are_the_blocks_of_its_page(page):
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    made = json.loads(PAGES.notebook(text))
    code = ["".join(cell["source"]) for cell in made["cells"] if cell["cell_type"] == "code"]
    assert code == [block.strip() for block in re.findall(r"^```python\n(.*?)^```", text, re.S | re.M)]
    words = "".join("".join(cell["source"]) for cell in made["cells"] if cell["cell_type"] == "markdown")
    assert words.startswith("# ")
    assert ".md)" not in words
    assert "](figures" not in words
