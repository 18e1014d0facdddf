"""Formulas as drawings (SVG) made while the site is built: no script, no font and no network to read them."""

from __future__ import annotations

import html

import ziamath
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

SIZE = 17.0  # px; letters as tall as those of the text around
ziamath.config.svg2 = False  # letters as outlines: what a page defines once, another formula's could replace


def drawing(tex: str, display: bool) -> str:
    """One formula in the colour of the text, on its baseline; screen readers are given the TeX."""
    formula = ziamath.Latex(tex, size=SIZE, inline=not display, color="currentColor")
    below = formula.getyofst() - 1  # the drawing has an edge of one pixel
    said = html.escape(tex, quote=True)
    return f'<span role="img" aria-label="{said}" style="vertical-align:{below:.2f}px">{formula.svg()}</span>'


def inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(f'<span class="formula">{drawing(node.astext(), False)}</span>')
    raise nodes.SkipNode


def block(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(f'<div class="formula">{drawing(node.astext(), True)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("drawn", (inline, None), (block, None))
    return {"parallel_read_safe": True}
