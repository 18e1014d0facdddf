"""Scripts of examples/records, run once for all tests of their page."""

import contextlib
import importlib
import io
import re
import sys
import warnings

import modfun as mf
import pytest
from places import ROOT

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def words_and_numbers(line):
    return NUMBER.sub("#", " ".join(line.split())), [float(one) for one in NUMBER.findall(line)]


def is_printed(line, printed):
    """Whether some line printed has the same words and, within 1 %, the same numbers."""
    words, values = words_and_numbers(line)
    same = [found for other, found in printed if other == words]
    return any(values == pytest.approx(found, rel=0.01) for found in same)


def run(name):
    """main() of a script; the page's ```text blocks must be what it prints."""
    folder = str(ROOT / "examples" / "records")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    module = importlib.import_module(name)
    out = io.StringIO()
    with contextlib.redirect_stdout(out), warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)  # real noise is rarely white, and fits say so
        try:
            numbers = module.main()
        except sys.modules["common"].Absent as reason:
            pytest.skip(str(reason))
    printed = [words_and_numbers(line) for line in out.getvalue().splitlines()]
    page = (ROOT / "docs" / "records" / f"{name}.md").read_text(encoding="utf-8")
    for block in re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE):
        for line in filter(str.strip, block.splitlines()):
            assert is_printed(line, printed), f"{name}.md shows what is not printed: {line}"
    return numbers


@pytest.fixture(scope="session")
def record_page():
    """record_page("tu144") is what main() of its script returns; skips where its records are absent."""
    done = {}

    def once(name):
        if name not in done:
            done[name] = run(name)
        return done[name]

    return once
