"""Docstrings of what is public: the sections readers look for, and examples that run as written."""

import doctest
import inspect
import sys
import types
import warnings

import modfun as mf
import pytest

SECTIONS = ("See Also", "References", "Examples")


def public():
    """Every public function and class by its name, those of the public modules included."""
    found = {}
    for name in mf.__all__:
        thing = getattr(mf, name)
        if isinstance(thing, types.ModuleType):
            found |= {f"{name}.{inner}": getattr(thing, inner) for inner in thing.__all__}
        elif callable(thing):
            found[name] = thing
    return found


PUBLIC = public()


def documented():
    """Docstrings with examples: of public things and of the methods of public classes."""
    for name, thing in PUBLIC.items():
        things = {name: thing}
        if isinstance(thing, type):
            members = {n: inspect.getattr_static(thing, n) for n in dir(thing) if not n.startswith("_")}
            things |= {f"{name}.{n}": m for n, m in members.items()}
        for full, one in things.items():
            text = inspect.getdoc(one)
            if text and ">>>" in text and (one is thing or full.startswith(name)):
                yield full, thing, text


EXAMPLES = {full: (thing, text) for full, thing, text in documented()}


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_thing_has_the_sections(name):
    text = inspect.getdoc(PUBLIC[name])
    heads = {
        line
        for line, under in zip(text.split("\n"), text.split("\n")[1:], strict=False)
        if set(under) == {"-"}
    }
    missing = [section for section in SECTIONS if section not in heads]
    assert not missing, f"{name} lacks {missing}"


@pytest.mark.parametrize("name", PUBLIC)
def test_see_also_names_what_exists(name):
    text = inspect.getdoc(PUBLIC[name])
    lines = text.split("See Also\n--------\n")[1].split("\n\n")[0].split("\n")
    for line in lines:
        target = line.split(" : ")[0]
        assert target.startswith("modfun."), line
        thing = mf
        for part in target.split(".")[1:]:
            thing = getattr(thing, part)


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_run_as_written(name, tmp_path, monkeypatch):
    if "plot" in name:
        import matplotlib

        matplotlib.use("agg")
    monkeypatch.chdir(tmp_path)
    thing, text = EXAMPLES[name]
    names = dict(vars(sys.modules[inspect.unwrap(thing).__module__]))
    example = doctest.DocTestParser().get_doctest(text, names, name, None, 0)
    said: list[str] = []
    with warnings.catch_warnings():
        failed, tried = doctest.DocTestRunner(verbose=False).run(example, out=said.append)
    assert tried
    assert not failed, "".join(said)


@pytest.mark.parametrize(
    "name",
    [n for n, thing in PUBLIC.items() if not isinstance(thing, type) or not issubclass(thing, Exception)],
)
def test_signatures_show_no_catch_alls(name):
    assert "unknown" not in inspect.signature(PUBLIC[name]).parameters
