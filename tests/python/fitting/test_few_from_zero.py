"""Doses at few times from zero: the trend is an offset of the measurement, and calls repeat the options."""

import modfun as mf
import numpy as np
import pytest

ORAL = mf.Equation(
    ["g' = -ka*g + u", "c' = ka*g/V - ke*c"],
    outputs=["c"],
    hidden=["g"],
    params={"V": mf.Free(15, min=1), "ka": mf.Free(1, min=0.01), "ke": mf.Free(0.2, min=0)},
)
HOURS = np.insert(np.array([0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 10, 12, 16, 24]), 1, 0.01)
TRUE = {"V": 20.0, "ka": 1.2, "ke": 0.25}


def blood(seed, offset=0.3, lag=0.0):
    since = np.maximum(HOURS - lag, 0.0)
    c = 100 * 1.2 / (20 * 0.95) * (np.exp(-0.25 * since) - np.exp(-1.2 * since))
    c = c + offset + 0.05 * np.random.default_rng(seed).standard_normal(HOURS.size)
    dose = np.where(np.arange(HOURS.size) == 0, 100 / 0.01, 0.0)
    return mf.Record(y=c, u=dose, t=HOURS, mask=HOURS != 0.01, outputs=["c"], intersample="zoh")


@pytest.mark.parametrize(("seed", "offset"), [(0, 0.3), (1, 0.3), (2, 0.0), (3, 1.0)])
def test_an_offset_beside_a_start_at_zero_is_that_of_output_error(seed, offset):
    """The search never ended: ka and ke met at 0.58, V was 17."""
    rec = blood(seed, offset)
    fit = mf.fit(rec, ORAL, initial_state="zero", trend="constant")
    assert fit.status == "ok"
    least = mf.rivals.output_error(ORAL, start=TRUE, initial_state="zero", trend="constant")(rec)
    for name, value in TRUE.items():
        assert fit[name] == pytest.approx(least[name], rel=1e-3)
        assert abs(fit[name] - value) < 3.5 * fit.bse[list(fit.param_names).index(name)]
    assert np.sqrt(np.mean((fit.predict(rec).y - rec.y)[rec.mask] ** 2)) < 0.08
    assert not any("failed" in text or "follow each other" in text for text in fit.check())


def test_a_baseline_is_the_first_thing_to_try():
    with pytest.warns(mf.ModfunWarning, match='an offset of c, trend="constant"'):
        plain = mf.fit(blood(0), ORAL, initial_state="zero")
    offset = mf.fit(blood(0), ORAL, initial_state="zero", trend="constant")
    assert offset.bic < plain.bic - 5


def test_the_cure_of_a_search_that_ends_nowhere_repeats_its_options(monkeypatch):
    monkeypatch.setattr("modfun.fitting.fit.by_response", lambda fit: fit)
    rec = blood(0)
    with pytest.warns(mf.ModfunWarning, match="Sums over the samples err") as found:
        mf.fit(rec, ORAL, initial_state="zero", trend="constant")
    code = 'start=dict(fit.params), initial_state="zero", trend="constant")(rec)'
    assert code in str(found[0].message)


def test_a_lag_is_named_where_no_search_can_find_it():
    with pytest.warns(mf.ModfunWarning, match="compare several lags"):
        mf.fit(blood(0, 0.0, 0.4), ORAL, initial_state="zero")
    late = mf.Equation(
        ["g' = -ka*g + u(t - L)", "c' = ka*g/V - ke*c"],
        outputs=["c"],
        hidden=["g"],
        params={"L": mf.Free(0.2, min=0, max=1)},
    )
    with pytest.raises(mf.DataError, match="of doses at few samples shift the rows"):
        mf.fit(blood(0, 0.0, 0.4), late, initial_state="zero")
