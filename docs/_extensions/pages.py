"""Pages stay plain Markdown, readable on a code host; what the site needs besides is added as they are read.

* Executed pages (`executed_pages`): ```python blocks become cells of one notebook, and their output is shown.
  A ```text block or a figure right after such a block is its output as a code host shows it: it is left out.
* Section pages (`section_pages`): the pages they link to, in that order, are their table of contents.
"""

from __future__ import annotations

import re
from fnmatch import fnmatch

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


def cells(text: str) -> str:
    """The page as a notebook."""
    return NOTEBOOK + CELL.sub(r"```{code-cell} python3\n\1```\n", text)


def contents(text: str) -> str:
    """The page with a table of contents made of its links."""
    pages = dict.fromkeys(LINK.findall(text))
    return "\n".join([text, "```{toctree}", ":hidden:", "", *pages, "```", ""])


def read(app: Sphinx, page: str, source: list[str]) -> None:
    if any(fnmatch(page, pattern) for pattern in app.config.section_pages):
        source[0] = contents(source[0])
    elif any(fnmatch(page, pattern) for pattern in app.config.executed_pages):
        source[0] = cells(source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_config_value("executed_pages", [], "env")
    app.add_config_value("section_pages", [], "env")
    app.connect("source-read", read)
    return {"parallel_read_safe": True}
