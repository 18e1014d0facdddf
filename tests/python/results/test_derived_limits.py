"""Limits of derived quantities are those of the parameters they are made of; fits of one record compare."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest

TIMES = np.array([0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4, 4.5, 5, 5.5, 6, 7, 8, 9, 10, 12.0])
GROWTH = mf.Equation(
    "x' = r*x*(1 - x/K)", outputs=["x"], params={"r": mf.Free(1, min=0), "K": mf.Free(10, min=0.1)}
)


@pytest.mark.parametrize("noise", ["output", "log-normal"])
def test_a_parameter_derived_from_itself_has_its_own_limits(noise: str) -> None:
    """They were 1.3 to 1.7 times as wide: the few lines of sums lent their degrees of freedom."""
    clean = 8.0 / (1 + (8.0 / 0.1 - 1) * np.exp(-0.9 * TIMES))
    for seed in range(3):
        e = np.random.default_rng(seed).standard_normal(TIMES.size)
        y = clean * np.exp(0.1 * e) if noise == "log-normal" else clean + 0.3 * e
        fit = mf.fit(mf.Record(y=y, t=TIMES, outputs=["x"]), GROWTH, noise=noise)
        table = fit.derived(r="r", K="K")
        limits = np.column_stack([table["low"], table["high"]])
        assert limits == pytest.approx(fit.conf_int(), rel=1e-6), seed


def test_fits_that_read_a_record_otherwise_share_it() -> None:
    duffing = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
    linear = mf.Equation("y'' + d*y' + a*y = u")
    rec = mf.simulate(
        linear.model({"d": 0.3, "a": 1.0}),
        input="2*sin(1.1*t) + sin(2.3*t)",
        duration=20,
        intervals=400,
        initial_state=[0.5, 0],
        nsr=0.1,
        seed=0,
    )
    rec = mf.Record(y=rec.y, u=rec.u, t=rec.t)
    small, large = mf.fit(rec, linear), mf.fit(rec, duffing)
    found = mf.compare({"small": small, "large": large})
    assert found["model"].tolist() == ["small", "large"]
    other = mf.fit(mf.Record(y=rec.y + 1e-6, u=rec.u, t=rec.t), duffing)
    with pytest.raises(mf.DataError, match="do not share one record"):
        mf.compare({"small": small, "large": other})
