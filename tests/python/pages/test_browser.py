"""The pages in a real browser: nothing is fetched, nothing complains, nothing sticks out, light and dark."""

import re

import modfun as mf
import numpy as np
import pytest
from browser import CHROMIUM, browser

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium to open the pages in")
NAME = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """A fit of two outputs of bad name with masks and many samples, and a study."""
    folder = tmp_path_factory.mktemp("pages")
    system = mf.ss([[-1, 1], [-6, -1.5]], [[-0.1], [-8]], np.eye(2))
    dt, t = 0.005, 0.005 * np.arange(4001)
    u = np.sin(t**2 / 8)
    y = system.simulate(u=u, dt=dt) + 0.02 * np.random.default_rng(0).normal(size=(2, t.size))
    rec = mf.Record(
        y=y, u=u, dt=dt, outputs=[NAME, "a_long_name_of_a_channel_" * 3], mask=np.abs(t - 9) > 0.3
    )
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1, denominator="common"), harmonics=12)
    study = mf.MonteCarlo(
        system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=64, nsr=[0.1, 0.2],
        estimators=["ls", "ml"], harmonics=6, trend=None, replicates=20, seed=1,
    ).run(progress=False)  # fmt: skip
    return {"fit": fit.report(folder / "fit.html"), "study": study.report(folder / "study.html")}


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    pytest.importorskip("websockets")
    with browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


def light(tab, element, property):
    """Sum of the three parts of a colour."""
    colour = tab.value(f"getComputedStyle(document.querySelector('{element}')).{property}")
    return sum(int(part) for part in re.findall(r"\d+", colour)[:3])


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1300, 390])
@pytest.mark.parametrize("kind", ["fit", "study"])
def test_page(pages, tab, kind, width, scheme):
    tab.open(pages[kind], width=width, scheme=scheme)
    assert tab.requests() == [pages[kind].as_uri()]
    assert tab.complaints() == []
    assert tab.value("innerWidth") == width
    assert tab.value("document.documentElement.scrollWidth") <= width
    assert tab.value("document.querySelectorAll('script').length") == 0
    paper = light(tab, "body", "backgroundColor")
    ink = light(tab, "body", "color")
    assert (paper > 600) == (scheme == "light")
    assert abs(paper - ink) > 400
    assert light(tab, ".drawing svg text", "fill") == ink


def test_bad_names_are_read_as_text(pages, tab):
    tab.open(pages["fit"], width=1300, scheme="light")
    assert NAME in tab.value("document.body.innerText")
    assert "<script>alert(1)" in tab.value("document.querySelector('svg').textContent")


def test_every_drawing_and_table_says_what_it_is(pages, tab):
    tab.open(pages["fit"], width=1300, scheme="light")
    assert tab.value("document.documentElement.lang") == "en"
    count = tab.value("document.querySelectorAll('figure').length")
    assert count >= 7
    assert tab.value("document.querySelectorAll('figure [role=img][aria-label] svg').length") == count
    assert tab.value("document.querySelectorAll('figure figcaption').length") == count
    assert tab.value("[...document.querySelectorAll('table')].every(t => t.querySelector('th[scope=col]'))")
    assert tab.value("[...document.querySelectorAll('nav a')].every(a => document.querySelector(a.hash))")
