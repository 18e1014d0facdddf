"""Code in pages leads on: `mf.fit` to the reference, `examples/x.py` to the file."""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.application import Sphinx

PUBLIC = re.compile(r"mf\.([\w.]*\w)(?:\(.*\))?")
SCRIPT = re.compile(r"(?<!\[)`(examples/[\w/]+\.(?:py|sh))`")


def scripts(app: Sphinx, page: str, source: list[str]) -> None:
    """A file that is named becomes a download."""
    if app.env.doc2path(page).suffix == ".md":
        root = "../" * (page.count("/") + 1)
        source[0] = SCRIPT.sub(rf"[`\1`]({root}\1)", source[0])


def names(app: Sphinx, page: nodes.document, docname: str) -> None:
    """A public name becomes a link, outside of headings and of other links."""
    known = app.env.get_domain("py").data["objects"]
    for code in list(page.findall(nodes.literal)):
        named = PUBLIC.fullmatch(code.astext())
        entry = known.get(f"modfun.{named[1]}") if named else None
        if entry and not isinstance(code.parent, nodes.reference | nodes.title):
            place = f"{app.builder.get_relative_uri(docname, entry.docname)}#{entry.node_id}"
            link = nodes.reference("", "", internal=True, refuri=place)
            code.replace_self(link)
            link += code


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", scripts)
    app.connect("doctree-resolved", names)
    return {"parallel_read_safe": True}
