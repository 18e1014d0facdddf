"""Equations without a parameter, with which a selection of terms may end."""

from __future__ import annotations

import modfun as mf
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options


def test_an_equation_of_numbers_is_fitted_as_others_are() -> None:
    rec = mf.simulate(mf.tf([1], [1, 0.1]), input="sin(t)", duration=20.0, intervals=256, nsr=0.1, seed=1)
    fit = fit_quietly((rec,), mf.Equation("y' = u - 0.1*y"), Options())
    assert fit.params.size == 0
    assert fit.status == "ok"
