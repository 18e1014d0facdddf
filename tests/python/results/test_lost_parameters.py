"""State spaces with parameters that the outputs do not tell: what needs their numbers is left out."""

from __future__ import annotations

import warnings

import modfun as mf
import numpy as np
import pytest

BY_MOUTH = mf.StateSpace(
    [["-ka", 0], ["ka/V", "-ke"]], C=[0, 1], states=["g", "c"], outputs=["c"],
    params={"V": mf.Free(15, min=1), "ka": mf.Free(1, min=0.01)},
)  # fmt: skip


def test_checks_and_summaries_do_without_a_model() -> None:
    """Two parts of every check failed, and no summary was printed."""
    t = np.arange(0, 24.01, 0.1)
    c = 6.3 * (np.exp(-0.25 * t) - np.exp(-1.2 * t)) + 0.02 * np.random.default_rng(0).normal(size=t.size)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = mf.fit(mf.Record(y=c, dt=0.1, outputs=["c"]), BY_MOUTH)
    assert fit.param_names == ("ka", "ke")
    assert "failed" not in str(fit.check())
    assert "1.19" in str(fit.summary())
    with pytest.raises(mf.SpecError, match="V cannot be found from c"):
        fit.damp()
