"""What indexes and readers are told of the package is complete, and the same everywhere."""

import re
import tomllib

import pytest
from places import ROOT

CARGO = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
VERSION = CARGO["workspace"]["package"]["version"]
MANIFESTS = sorted([ROOT / "Cargo.toml", *ROOT.glob("rust/*/Cargo.toml")])


def test_the_citation_has_what_the_format_requires_and_this_version():
    yaml = pytest.importorskip("yaml")
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["version"] == VERSION
    assert citation["license"] == PROJECT["license"]
    assert all("name" in author or "family-names" in author for author in citation["authors"])
    for reference in citation["references"]:
        assert {"type", "title", "authors"} <= set(reference)


def test_the_first_heading_of_the_changes_is_this_version_and_has_its_numerics():
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    heading, body = re.search(r"^## (.+?)\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE).groups()
    assert heading.split(",")[0] == VERSION
    numerics = re.search(r"^### Numerics\n(.+?)(?=^###|\Z)", body, re.DOTALL | re.MULTILINE)
    assert numerics, "changes of numbers have a heading of their own"
    assert "\n* " in numerics[1], "they are listed, or it is said that there are none"


@pytest.mark.parametrize("manifest", MANIFESTS, ids=lambda path: path.parent.name)
def test_crates_share_version_licence_and_edition(manifest):
    package = tomllib.loads(manifest.read_text("utf-8"))["package"]
    for name in ("version", "license", "edition", "rust-version"):
        assert package[name] == {"workspace": True}, f"{manifest}: {name}"


def test_the_version_is_that_of_the_crates():
    assert PROJECT["dynamic"] == ["version"]
    for part in ("modfun-dense", "modfun-fft"):
        assert CARGO["dependencies"][part]["version"] == VERSION, part


def test_the_extra_all_is_the_sum_of_the_others_and_dev_holds_it():
    extras = dict(PROJECT["optional-dependencies"])
    tools, everything = extras.pop("dev"), extras.pop("all")
    assert set(everything) == {need for needs in extras.values() for need in needs}
    assert set(everything) <= set(tools)


def test_every_need_has_a_lower_bound():
    """`make test-wheel` installs these versions."""
    for need in PROJECT["dependencies"] + PROJECT["optional-dependencies"]["all"]:
        assert re.fullmatch(r"[a-z0-9]+>=\d+(\.\d+)*", need), need


def test_what_an_index_shows_is_there():
    assert {"name", "description", "readme", "license", "keywords", "classifiers", "authors"} <= set(PROJECT)
    for name in PROJECT["license-files"]:
        assert (ROOT / name).stat().st_size > 1000
