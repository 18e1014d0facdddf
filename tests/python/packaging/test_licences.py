"""Every crate in the compiled core is shipped with its licence, and all are permissive."""

import importlib.util
import shutil
import sys
import tomllib

import pytest
from places import ROOT


@pytest.fixture(scope="module")
def licences():
    """packaging/licences.py as a module."""
    spec = importlib.util.spec_from_file_location("licences", ROOT / "packaging" / "licences.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["licences"] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def crates(licences):
    if shutil.which("cargo") is None:
        pytest.skip("cargo is not installed: what is linked cannot be asked")
    return licences.crates()


def test_every_linked_crate_is_there_with_its_text(licences, crates):
    assert licences.lacking(licences.FILE.read_text("utf-8"), crates) == []


def test_the_crates_are_those_of_the_lock_file(crates):
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text("utf-8"))["package"]
    foreign = {(package["name"], package["version"]) for package in lock if "source" in package}
    assert {crate[:2] for crate in crates} <= foreign
    assert {"libm", "numpy", "pyo3", "rustfft"} <= {crate.name for crate in crates}
    assert "criterion" not in {crate.name for crate in crates}, "benches are not shipped"


def test_a_crate_without_its_text_is_seen(licences, crates):
    text = licences.FILE.read_text("utf-8")
    first = crates[0]
    assert licences.lacking(text, [first._replace(version="99.0.0"), *crates[1:]]) == [
        f"missing: {first.name} 99.0.0: {first.licence}",
        f"not linked: {first.heading}",
    ]
    assert licences.lacking(text, [first._replace(text="other words"), *crates[1:]]) == [
        f"text: {first.heading}"
    ]


@pytest.mark.parametrize(
    ("offered", "taken"),
    [
        ("MIT", "MIT"),
        ("Apache-2.0 OR MIT", "MIT"),
        ("MIT/Apache-2.0", "MIT"),
        ("BSD-2-Clause", "BSD-2-Clause"),
    ],
)
def test_of_a_choice_one_is_taken(licences, offered, taken):
    assert licences.chosen(offered) == taken


@pytest.mark.parametrize("offered", ["GPL-3.0-only", "MPL-2.0", "MIT AND GPL-2.0-only"])
def test_what_is_not_permissive_is_refused(licences, offered):
    with pytest.raises(SystemExit, match="look at it"):
        licences.chosen(offered)
