"""Prose of pages and of files beside them: numbers begin with a digit, and some phrases do not come back.

Left out are blocks of code and code type.
"""

import ast
import re

import pytest
from places import ROOT

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
NOT_PROSE = re.compile(r"^```.*?^```$|`[^`\n]+`|\]\([^)]*\)", re.DOTALL | re.MULTILINE)
BARE = re.compile(r"(?<![\w.])\.\d")
# Each with what to write instead.
TELEGRAPHIC = {
    r"\band says so\b": "warns, reports or raises an error",
    r"\bto be had\b": "available, or: modfun has it",
    r"\bone an (?:in|out)put\b": "one per input",
    r"\ba (?:row|column) an? \w": "each row is a noise level",
    r"\bnobody knows\b": "unknown",
    r"\bso that it is coarse\b": "so approximate",
    r"\b(?:is|are) taken as\b": "is treated as, is assumed",
    r"\bholds? the truth\b": "contains the true value",
    r"\bsamples a (?:period|second)\b": "samples per period",
    r"(?:µs|ms|time) a (?:fit|record|call)\b": "ms per fit",
}


def faults(text):
    """Every bare decimal and telegraphic phrase with its line and the cure."""
    prose = NOT_PROSE.sub(lambda found: re.sub(r"[^\n]", "x", found[0]), text)
    found = [(hit, "a digit before the point") for hit in BARE.finditer(prose)]
    for phrase, cure in TELEGRAPHIC.items():
        found += [(hit, cure) for hit in re.finditer(phrase, prose, re.IGNORECASE)]
    return [(prose.count("\n", 0, hit.start()) + 1, hit[0], cure) for hit, cure in found]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_prose_has_no_bare_decimal_and_no_telegraphic_phrase(page):
    assert faults(page.read_text(encoding="utf-8")) == []


DRAWN = [*(ROOT / "examples").rglob("*.py"), *(ROOT / "benches").glob("*_figures.py")]


def texts(source):
    """Texts of a program, without docstrings and without the formats of numbers."""
    nodes = list(ast.walk(ast.parse(source)))
    left_out = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    specs = [node.format_spec for node in nodes if isinstance(node, ast.FormattedValue)]
    left_out |= {id(part) for spec in specs if spec is not None for part in ast.walk(spec)}
    return [
        node.value
        for node in nodes
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in left_out
    ]


@pytest.mark.parametrize("program", sorted(DRAWN), ids=lambda path: path.stem)
def test_labels_of_figures_and_what_examples_print_have_no_bare_decimal(program):
    written = [re.sub(r"\{[^{}]*\}|%[.\d]+[efg]", "x", text) for text in texts(program.read_text("utf-8"))]
    assert [text for text in written if BARE.search(text)] == []


def test_faults_are_found_in_prose_and_nowhere_else():
    text = "Off by .085 or 0.1, one an input\n`.5`, [x](a.5)\n```text\n.3, and says so\n```\nIs taken as 1."
    found = [(line, word) for line, word, _ in faults(text)]
    assert found == [(1, ".0"), (1, "one an input"), (6, "Is taken as")]
