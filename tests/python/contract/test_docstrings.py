"""Every public name is documented in numpydoc, and every keyword it takes."""

import inspect
import re
import types

import modfun as mf
import pytest

TYPES = {name: thing for name in mf.__all__ if isinstance(thing := getattr(mf, name), type)}
EXCEPTIONS = {name for name, thing in TYPES.items() if issubclass(thing, Exception)}
# Made by functions, never by users: their attributes are what is documented.
RESULTS = {
    "Fit",
    "FitMany",
    "Reduction",
    "Results",
    "rivals.ARX",
    "rivals.OutputError",
    "rivals.PredictionError",
}
UNDERLINED = re.compile(r"^(\w+)\n-{3,}$", re.MULTILINE)


def public():
    """Names and objects: everything in `mf.__all__`, in its modules' `__all__`, and public methods."""
    found = {}
    for name in mf.__all__:
        thing = getattr(mf, name)
        if isinstance(thing, types.ModuleType):
            inner = getattr(thing, "__all__", [])
            found |= {f"{name}.{part}": getattr(thing, part) for part in inner}
        elif callable(thing):
            found[name] = thing
    for name, thing in list(found.items()):
        if isinstance(thing, type) and name.split(".")[-1] not in EXCEPTIONS:
            for part, member in inspect.getmembers_static(thing):
                plain = member.__func__ if isinstance(member, classmethod | staticmethod) else member
                if not part.startswith("_") and inspect.isfunction(plain):
                    found[f"{name}.{part}"] = plain
    return {
        name: thing for name, thing in found.items() if inspect.isfunction(thing) or isinstance(thing, type)
    }


PUBLIC = public()
CALLS = {k: v for k, v in PUBLIC.items() if k.split(".")[-1] not in EXCEPTIONS}


def sections(thing):
    """Underlined sections of a docstring with their text."""
    parts = UNDERLINED.split(inspect.getdoc(thing) or "")
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def documented(text):
    """Names that a section Parameters (or Attributes) describes: `a, b : type`, `**options`."""
    heads = re.findall(r"^(\*{0,2}\w+(?:, *\*{0,2}\w+)*)(?: *:.*)?$", text, re.MULTILINE)
    return {name.strip().lstrip("*") for head in heads for name in head.split(",")}


def test_there_is_something_to_walk():
    assert {"fit", "Record", "Record.window", "rivals.pem", "Fit.cov_params"} <= set(CALLS)


@pytest.mark.parametrize("name", PUBLIC)
def test_it_says_what_it_is(name):
    first = (inspect.getdoc(PUBLIC[name]) or "").split("\n")[0]
    assert first.endswith((".", ":", ",")) or len(first) > 20, f"{name} has no opening sentence: {first!r}"


@pytest.mark.parametrize("name", CALLS)
def test_every_keyword_is_documented(name):
    thing = CALLS[name]
    given = [p for p in inspect.signature(thing).parameters.values() if p.name not in ("self", "cls")]
    if not given or name in RESULTS:
        return
    found = sections(thing)
    if isinstance(thing, type):
        found = sections(thing.__init__) | found
    known = documented(found.get("Parameters", "")) | documented(found.get("Attributes", ""))
    one_line = "\n" not in (inspect.getdoc(thing) or "").strip() and "." in name
    if one_line and not isinstance(thing, type):
        return  # a method told in one sentence
    # `**unknown` is there to be refused in words.
    missing = [p.name for p in given if p.name not in known and p.name != "unknown"]
    assert not missing, f"{name} does not document {missing}"


@pytest.mark.parametrize("name", [k for k, v in CALLS.items() if "." not in k and inspect.isfunction(v)])
def test_functions_say_what_they_return_and_raise(name):
    found = sections(CALLS[name])
    assert "Returns" in found, f"{name} does not say what it returns"
    source = inspect.getsource(CALLS[name])
    if re.search(r"^\s+raise \w+Error", source, re.MULTILINE):
        assert "Raises" in found, f"{name} raises and does not say what"
