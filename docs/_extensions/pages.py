"""Pages stay plain Markdown, readable on a code host; what the site needs besides is added as they are read.

* Executed pages (`executed_pages`): ```python blocks become cells of one notebook, and their output is shown.
  A ```text block or a figure right after such a block is its output as a code host shows it: it is left out.
* Section pages (`section_pages`): the pages they link to, in that order, are their table of contents.
* Notebooks (`notebooks`): executed pages that can be downloaded as .ipynb files.
* The index of the reference has a line for each public name, from the tables of its pages.
"""

from __future__ import annotations

import json
import re
from fnmatch import fnmatch
from pathlib import Path

from sphinx.application import Sphinx

# Only what is printed or drawn is shown, as where the page is run as a script.
NOTEBOOK = """---
file_format: mystnb
kernelspec:
  name: python3
---
```{code-cell} python3
:tags: [remove-cell]
%config InteractiveShell.ast_node_interactivity = "none"
%config InlineBackend.figure_formats = ["svg"]
```

"""
OUTPUT = r"\n(?:```text\n.*?^```|!\[[^\]\n]*\]\([^)\n]*\))\n"
CELL = re.compile(rf"^```python\n(.*?)^```\n(?:{OUTPUT})*", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\((?!https?:)([^)\s#]+)\.md\)")
ELSEWHERE = re.compile(r"\[([^\]]+)\]\((?!https?:)[^)\s]+\)")
TABLE = re.compile(r"^\.\. autosummary::\n(?: +:.*\n)*\n((?: +.+\n)+)", re.MULTILINE)


def cells(text: str) -> str:
    """The page as a notebook."""
    return NOTEBOOK + CELL.sub(r"```{code-cell} python3\n\1```\n", text)


def contents(text: str) -> str:
    """The page with a table of contents made of its links."""
    pages = dict.fromkeys(LINK.findall(text))
    return "\n".join([text, "```{toctree}", ":hidden:", "", *pages, "```", ""])


def notebook(text: str) -> str:
    """The page as an .ipynb file without outputs; links to other pages are plain words there."""
    cells, at = [], 0

    def add(kind: str, lines: str) -> None:
        if lines.strip():
            code = {"execution_count": None, "outputs": []} if kind == "code" else {}
            cells.append(
                {"cell_type": kind, "metadata": {}, "source": lines.strip().splitlines(True), **code}
            )

    for found in CELL.finditer(text):
        add("markdown", ELSEWHERE.sub(r"\1", text[at : found.start()]))
        add("code", found[1])
        at = found.end()
    add("markdown", ELSEWHERE.sub(r"\1", text[at:]))
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    whole = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 4}
    return json.dumps(whole, indent=1, ensure_ascii=False)


def offered(app: Sphinx, page: str, text: str) -> str:
    """The page with a link to itself as a notebook, which is written beside the site's pages."""
    file = Path(app.outdir) / "notebooks" / f"{Path(page).name}.ipynb"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(notebook(text), encoding="utf-8")
    title, rest = text.split("\n", 1)
    up = "../" * page.count("/")
    link = f'<p><a href="{up}notebooks/{file.name}" download>Download this page as a notebook</a></p>'
    return f"{title}\n\n{link}\n{rest}"


def overview(folder: Path, text: str) -> str:
    """The index of the reference with the names of its pages, by page."""
    parts = [text, ".. currentmodule:: modfun", ""]
    for page in re.findall(r"^   (\w+)$", text, re.MULTILINE):
        title, _, rest = (folder / f"{page}.rst").read_text(encoding="utf-8").split("\n", 2)
        names = [f"   {name}" for table in TABLE.findall(rest) for name in table.split()]
        intro = rest.strip().split("\n\n")[0]
        table = [".. autosummary::", "   :nosignatures:", "", *names] if names else []
        parts += [
            "",
            f":doc:`{title} <{page}>`",
            "-" * (len(title) + len(page) + 10),
            "",
            intro,
            "",
            *table,
            "",
        ]
    return "\n".join(parts)


def read(app: Sphinx, page: str, source: list[str]) -> None:
    if page in app.config.notebooks:
        source[0] = offered(app, page, source[0])
    if page == "reference/index":
        source[0] = overview(Path(app.srcdir) / "reference", source[0])
    elif any(fnmatch(page, pattern) for pattern in app.config.section_pages):
        source[0] = contents(source[0])
    elif any(fnmatch(page, pattern) for pattern in app.config.executed_pages):
        source[0] = cells(source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_config_value("executed_pages", [], "env")
    app.add_config_value("section_pages", [], "env")
    app.add_config_value("notebooks", [], "env")
    app.connect("source-read", read)
    return {"parallel_read_safe": True}
