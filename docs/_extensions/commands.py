"""`.. commands::` writes the reference of the command line from the commands themselves."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer
from docutils import nodes
from modfun.commands.app import app as modfun_app
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


def told(command: Any, context: Any) -> Iterator[str]:
    """A command, its arguments and options, then the commands below it; in reStructuredText."""
    path = context.command_path
    inner = getattr(command, "commands", {})
    if not inner:
        usage = " ".join([path, *command.collect_usage_pieces(context)])
        yield from (path, "-" * len(path), "", f"``{usage}``", "")
        yield from (command.help, "")
        for parameter in command.get_params(context):
            names, meaning = parameter.get_help_record(context)
            if names != "--help":
                kinds = re.sub(r"<list\[(\w+)\]>", r"<\1>", names).replace("<Path>", "<path>")
                yield from (f"``{kinds}``", f"    {meaning}", "")
    for name, below in inner.items():
        yield from told(below, below.make_context(name, [], parent=context, resilient_parsing=True))


class Commands(SphinxDirective):
    def run(self) -> list[nodes.Node]:
        command = typer.main.get_command(modfun_app)
        context = command.make_context("modfun", [], resilient_parsing=True)
        return self.parse_text_to_nodes("\n".join(told(command, context)), allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True}
