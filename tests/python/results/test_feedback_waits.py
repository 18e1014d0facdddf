"""What a fit has tried about a loop is not tried again, and structures that lower nothing not with rounds."""

import warnings

import loops
import modfun as mf
import pytest
from modfun.fitting import instruments


@pytest.fixture
def referenced(monkeypatch):
    """Fits with a reference that are made; counted by their rounds."""
    made, settled = [], instruments._Rounds.settled

    def counted(self, fit):
        made.append(self.structure)
        return settled(self, fit)

    monkeypatch.setattr(instruments._Rounds, "settled", counted)
    return made


def test_a_check_after_a_fit_tries_no_reference_again(referenced):
    """Both took some 20 fits with a reference, of seven fits each: 19 s and 12 s of 1,500 samples."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mf.fit(loops.record(0.1, 0, pole=0.9), loops.MODEL)
    assert 0 < len(referenced) < 15
    del referenced[:]
    assert "follows earlier residuals" in str(fit.check())
    assert not referenced
