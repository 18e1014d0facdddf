"""Attributes asked for by the names of other packages: each error names one that exists here."""

import re

import modfun as mf
import pytest
from modfun.base.elsewhere import FIT, FITS, PACKAGE, RECORD, STUDY, SYSTEM, TERMS

MODEL = mf.tf([5], [1, 3, 8])
REC = mf.simulate(MODEL, input="sin(t**2/5)", duration=10, intervals=256, nsr=0.1, seed=1)
SECOND = mf.TransferFunction(poles=2, zeros=0)

STUDIED = mf.MonteCarlo(
    system=MODEL, input="sin(t**2/5)", duration=10, intervals=64, nsr=0.1, harmonics=6, estimators=["ml"]
)


@pytest.fixture(scope="module")
def objects():
    return {
        "fit": mf.fit(REC, SECOND),
        "fits": mf.fit_many([REC, REC], SECOND),
        "record": REC,
        "study": STUDIED.run(replicates=8),
        "system": MODEL,
        "terms": mf.select_terms(REC, "y, y', u, 1", target="y''"),
    }


ASKED = [
    (kind, name, here)
    for kind, words in {
        "fit": FIT,
        "fits": FITS,
        "record": RECORD,
        "study": STUDY,
        "system": SYSTEM,
        "terms": TERMS,
    }.items()
    for name, here in words.items()
]


@pytest.mark.parametrize(("kind", "name", "here"), ASKED)
def test_the_error_names_an_attribute_that_there_is(objects, kind, name, here):
    with pytest.raises(AttributeError, match=rf"has no attribute '{name}': use {re.escape(here)}$"):
        getattr(objects[kind], name)
    for path in re.findall(r"(?:^|, or )((?:mf\.)?[a-z_0-9.]+)", here):
        found = mf if path.startswith("mf.") else objects[kind]
        for part in path.removeprefix("mf.").split("."):
            found = getattr(found, part)


def test_other_names_get_no_advice(objects):
    with pytest.raises(AttributeError, match=r"^'Fit' object has no attribute 'colour'$"):
        objects["fit"].colour  # noqa: B018


def test_an_attribute_error_inside_a_property_is_shown_as_it_is(monkeypatch):
    monkeypatch.setattr(mf.Fit, "bic", property(lambda self: [].first))
    with pytest.raises(AttributeError, match="'list' object has no attribute 'first'"):
        mf.fit(REC, SECOND).bic  # noqa: B018


@pytest.mark.parametrize(("name", "here"), PACKAGE.items())
def test_the_package_says_what_functions_of_matlab_are_called_here(name, here):
    with pytest.raises(AttributeError, match=rf"has no attribute '{name}': use {re.escape(here)}, see docs"):
        getattr(mf, name)
    for known in re.findall(r"mf\.(\w+)", here):
        getattr(mf, known)


def test_brackets_of_a_study_are_those_of_its_axes(objects):
    with pytest.raises(mf.SpecError, match=r"Results are not indexed with \[\]: use sel\(estimator='ml'\)$"):
        objects["study"]["ml"]
    with pytest.raises(mf.SpecError, match=r"use sel\(\.\.\.\), with labels of axes$"):
        objects["study"]["MLE"]


def test_a_bootstrap_names_what_holds_its_replicates(objects):
    again = mf.bootstrap(objects["fit"], replicates=4, progress=False)
    with pytest.raises(AttributeError, match=r"has no attribute 'samples': use params, \(replicate"):
        again.samples  # noqa: B018
