"""The examples on measured nonlinear systems: parameters and simulation errors near those of the page."""

import sys

import modfun as mf
import numpy as np
import pytest
from places import ROOT, measured

pytest.importorskip("sympy")
pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")


def run(monkeypatch, name, folder):
    """The example's fit as {name: (value, standard error)}, and its simulation error."""
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    monkeypatch.delitem(sys.modules, name, raising=False)
    fit, rms = __import__(name).main(measured(folder).parent)
    assert fit.success
    return dict(zip(fit.param_names, zip(fit.params, fit.bse, strict=True), strict=True)), rms


def test_silverbox(monkeypatch, capsys):
    """Windows elsewhere in the record gave m, d, k1 within a per cent, k3 within 2 %."""
    found, rms = run(monkeypatch, "silverbox", "silverbox_multisine")
    expected = {"m": 5.37e-6, "d": 2.255e-4, "k1": 0.990, "k3": 3.93}
    for name, value in expected.items():
        assert found[name][0] == pytest.approx(value, rel=0.02)
        assert found[name][1] < 0.02 * value
    assert rms < 0.6e-3
    printed = capsys.readouterr().out
    assert "of 54.8 mV" in printed
    record, equation = [float(part.split()[-1]) for part in printed.splitlines()[-1].split(" mV")[:2]]
    assert abs(20 * np.log10(record / equation)) < 1.0


def test_emps(monkeypatch):
    """The reference's least squares on filtered signals: within 3 standard errors and 2 %."""
    found, rms = run(monkeypatch, "emps", "emps_est")
    for name, value in {"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935}.items():
        assert found[name][0] == pytest.approx(value, rel=0.02)
        assert abs(found[name][0] - value) < 3 * found[name][1]
    assert found["OF"][0] == pytest.approx(-3.1648, rel=0.05)
    assert rms < 0.012


def test_tanks(monkeypatch):
    """Output error on the same samples, with outlets of their own, finds k = .0394."""
    found, rms = run(monkeypatch, "tanks", "cascaded_tanks_est")
    assert found["k"][0] == pytest.approx(0.0394, abs=0.004)
    assert found["k4"][0] == pytest.approx(0.0302, abs=0.004)
    assert np.isfinite(rms)
    assert rms < 1.5


def test_windows_of_the_tanks(monkeypatch):
    """The page's table: output error is right in all windows, the fit in five, and it warns in all."""
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    monkeypatch.delitem(sys.modules, "tanks", raising=False)
    tanks = __import__("tanks")
    with pytest.warns(mf.ModfunWarning) as said:
        table = tanks.windows(*tanks.read(measured("cascaded_tanks_est").parent))
    assert [sum(words in str(one.message) for one in said) for words in ("on a bound", "Eliminating h")] == [
        1,
        7,
    ]
    rival = [float(word.split()[0]) for word in table["k, output error"]]
    assert 0.034 < min(rival) < max(rival) < 0.046
    rows = zip(table["k, fit"], table["k4, fit"], rival, strict=True)
    free = [(k.split(), true) for k, gain, true in rows if "bound" not in k + gain]
    off = [
        abs(float(value) - true) - 1e-4 < float(error) for (value, _, error), true in free
    ]  # rounded to 1e-4
    assert (len(off), sum(off)) == (7, 5)
