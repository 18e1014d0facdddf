"""The page about a fit: its numbers, its words, its escaping, and the way it is written."""

import hashlib
import os
import re
import subprocess
import sys

import modfun as mf
import numpy as np
import pytest

SECOND = mf.TransferFunction(poles=2, zeros=0)
NAME = "<script>alert(1)</script> & $x$"


@pytest.fixture(scope="module")
def rec():
    return mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.05, seed=0
    )


@pytest.fixture(scope="module")
def fit(rec):
    return mf.fit(rec, SECOND)


@pytest.fixture(scope="module")
def page(fit, tmp_path_factory):
    return fit.report(tmp_path_factory.mktemp("page") / "fit.html").read_text(encoding="utf-8")


def test_numbers_of_the_fit_are_on_the_page(fit, page):
    for table in (fit.table(), fit.score(), mf.collinearity(fit.records, fit).table):
        head = 2 if table.units else 1  # names, and units
        cells = [word for line in repr(table).splitlines()[head:] for word in line.split()]
        assert len(cells) >= 5
        for cell in cells:
            assert f">{cell}</td>" in page
    assert f"{fit.band[1]:.4g} rad/s" in page


def test_provenance_has_versions_hashes_and_a_call_that_makes_the_fit_again(fit, rec, page):
    for text in (mf.__version__, np.__version__, ".".join(map(str, sys.version_info[:3]))):
        assert text in page
    for values in (rec.t, rec.y, rec.u):
        assert hashlib.sha256(values.tobytes()).hexdigest() in page
    code = re.search(r"import modfun as mf\n(.*?)</code>", page, re.DOTALL)[1]
    names = {"mf": mf, "rec": rec}
    exec(code, names)
    assert np.array_equal(names["fit"].params, fit.params)


def test_file_is_named_without_its_folder_and_hashed(rec, tmp_path, undrawn):
    folder = tmp_path / "secret_home"
    folder.mkdir()
    data = folder / "run7.csv"
    data.write_text(
        "t,y,u\n" + "\n".join(f"{a},{b},{c}" for a, b, c in zip(rec.t, rec.y[0], rec.u[0], strict=True))
    )
    read = mf.read(data, outputs="y", inputs="u")
    text = mf.fit(read, SECOND).report(tmp_path / "fit.html").read_text()
    assert "run7.csv" in text
    assert hashlib.sha256(data.read_bytes()).hexdigest() in text
    assert "secret_home" not in text
    assert str(tmp_path) not in text


def test_names_are_text_whatever_they_hold(rec, tmp_path):
    named = mf.Record(
        y=rec.y, u=rec.u, dt=rec.dt, outputs=NAME, inputs="u--><b>", units={NAME: '"><img src=x onerror=a>'}
    )
    text = mf.fit(named, SECOND).report(tmp_path / "fit.html", title="</title><i>&").read_text()
    assert "<script" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; $x$" in text
    assert "<b>" not in text
    assert "<img" not in text
    assert "<i>" not in text
    assert text.count("</title>") == 1


def test_page_needs_nothing_else(page):
    assert not re.search(r"(src|href)=[\"'](?!#|data:)", page)
    assert "@import" not in page
    assert "url(http" not in page
    ids = re.findall(r'\bid="([^"]*)"', page)
    assert len(ids) == len(set(ids))
    assert len(page) < 1.5e6


def test_returns_the_path_and_replaces_only_when_whole(fit, tmp_path, monkeypatch, undrawn):
    place = tmp_path / "fit.html"
    place.write_text("old")

    def fail(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", fail)
        with pytest.raises(mf.ModfunError, match=r"No space left on device.*make room"):
            fit.report(place)
        patched.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            fit.report(place)
    assert place.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["fit.html"]
    assert fit.report(str(place)) == place
    assert place.read_text().startswith("<!DOCTYPE html>")


@pytest.mark.parametrize(
    ("name", "said"),
    [("fit.pdf", "end it in .html"), ("none/fit.html", "there is no folder"), ("there.html", "is a folder")],
)
def test_a_place_that_does_not_serve_is_refused(fit, tmp_path, name, said):
    (tmp_path / "there.html").mkdir()
    with pytest.raises(mf.SpecError, match=said):
        fit.report(tmp_path / name)


@pytest.mark.process
@pytest.mark.parametrize("absent", ["jinja2", "matplotlib"])
def test_an_absent_package_is_named_with_its_cure(absent, tmp_path):
    code = (
        f"import sys; sys.modules[{absent!r}] = None; import modfun as mf, numpy as np\n"
        "t = np.arange(99) / 9\n"
        "fit = mf.fit(mf.Record(y=np.sin(t), u=np.cos(t), dt=1/9), mf.TransferFunction(poles=1))\n"
        "fit.report('fit.html')"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert f"a report needs {absent}: pip install 'modfun[report]'" in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_fit_that_did_not_settle_is_not_to_be_used(rec, tmp_path, undrawn):
    swapped = mf.Record(y=rec.u, u=rec.y, dt=rec.dt)
    with pytest.warns(mf.ModfunWarning, match="First swap them"):
        found = mf.fit(swapped, mf.TransferFunction(poles=2, zeros=2))
    text = found.report(tmp_path / "fit.html").read_text(encoding="utf-8")
    assert "Not to be used as it is: the fit did not settle." in text
    assert "Usable" not in text


def test_the_call_does_not_invent_how_a_file_was_read(rec, tmp_path, undrawn):
    rec.to_csv(tmp_path / "run.csv")
    read = mf.read(tmp_path / "run.csv", outputs="y", inputs="u", intersample="foh")
    text = mf.fit(read, SECOND).report(tmp_path / "fit.html").read_text(encoding="utf-8")
    assert "mf.read(" not in text
    assert "of run.csv, with the samples and words under Data" in text


def test_a_page_needs_a_name(fit):
    with pytest.raises(mf.SpecError, match="the file is 3; give its name as a text or a Path"):
        fit.report(3)


def test_powers_at_ticks_are_text(page):
    assert re.search(r">10⁻¹</text>", page)
    assert "mathdefault" not in page
