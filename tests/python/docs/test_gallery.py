"""The gallery: each script finds the parameters it was simulated with; docs/gallery.md says what it finds."""

import re
import runpy
from functools import cache

import matplotlib
import numpy as np
import pytest
from places import ROOT

SCRIPTS = sorted((ROOT / "examples" / "gallery").glob("*.py"))
PAGE = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
# Largest error of a parameter, % of its value; what is hard to see in its record stands by name.
WITHIN = {"delay": 20, "quadratic_drag": 10, "parabolic_damping": 6}
USUAL = 4


@cache
def ran(script):
    return runpy.run_path(str(script))


def test_there_are_sixteen():
    assert len(SCRIPTS) == 16


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_every_parameter_is_within_four_standard_errors_of_the_truth(script, capsys):
    """56 normal errors would pass 4 somewhere in .4 % of seeds; the seeds are fixed."""
    names = ran(script)
    fit = names["fit"]
    truth = np.array([names["truth"][name] for name in fit.param_names])
    assert set(fit.param_names) == set(names["truth"])
    assert fit.success
    assert np.all(np.abs(fit.params - truth) < 4 * fit.bse)
    within = WITHIN.get(script.stem, USUAL) / 100
    assert np.all(np.abs(fit.params / truth - 1) < within)
    assert np.all(fit.bse < within * np.abs(truth)), "an error bar that says nothing"


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_it_is_short_and_prints_its_parameters(script):
    text = script.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 40
    assert text.startswith('"""')
    assert "±" in text


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_the_page_shows_the_script_and_what_it_finds(script):
    fit = ran(script)["fit"]
    text = script.read_text(encoding="utf-8")
    section = PAGE.partition(f"`examples/gallery/{script.name}`")[2].partition("\n## ")[0]
    assert section, f"docs/gallery.md does not name {script.name}"
    assert (
        re.search(r"^\w+ = mf\.Equation\(.*?^(?=truth)", text, re.DOTALL | re.MULTILINE)[0].strip() in section
    )
    for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
        found = re.search(rf"\| `{name}` \| \S+ \| (\S+) ± (\S+) \|", section)
        assert found, name
        assert abs(float(found[1]) - value) < 0.1 * error + 10**-3 * abs(value)
        assert float(found[2]) == pytest.approx(error, rel=0.1)


@pytest.mark.parametrize("name", ["duffing", "lotka_volterra_prey", "parabolic_damping", "delay"])
def test_the_fit_follows_its_record(name):
    matplotlib.use("Agg")
    names = ran(ROOT / "examples" / "gallery" / f"{name}.py")
    fit, rec = names["fit"], names["rec"]
    noise = 0.05 if name != "duffing" else 0.1
    assert np.all(np.array(fit.score()["signal_to_error"]) > 20 * np.log10(1 / noise) - 6)
    assert np.array_equal(fit.predict().t, rec.t)
    drawn = np.ravel(fit.plot_response())
    assert len(drawn) == 2 * len(rec.outputs)
