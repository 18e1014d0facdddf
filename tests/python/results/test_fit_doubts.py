"""What fit and check say of errors, repeated samples and biased methods, where a user looks."""

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lfilter


def test_a_light_mode_in_white_noise_has_classical_errors_favoured_and_colour_has_hc3():
    light = mf.simulate(mf.tf([1], [1, 0.2, 1]), input="sin(t**2/5)", duration=10.0, intervals=256)
    rng = np.random.default_rng(3)
    white = rng.standard_normal(557)
    coloured = lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], white)
    for noise, said, unsaid in ((white, "nonrobust", "Take HC3"), (coloured, "Take HC3", "nonrobust")):
        rec = light.assign(y=light["y"] + 0.05 * np.sqrt(np.mean(light.y**2)) * noise[300:])
        fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), cov_type="HC3")
        text = str(fit.check())
        assert "standard errors differ" in text
        assert said in text
        assert unsaid not in text
        assert ("nonrobust" in fit.check().note) == (noise is white)


def test_samples_that_count_twice_are_told():
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=20.0, intervals=512, nsr=0.1, seed=1
    )
    two = mf.TransferFunction(poles=2, zeros=0)

    def part(first: int, last: int) -> mf.Record:
        return mf.Record(y=rec.y[:, first:last], u=rec.u[:, first:last], dt=rec.dt)

    for records, shared in (
        ([rec, rec], "0 and 1 share 513"),
        ([part(200, 513), part(0, 300)], "0 and 1 share 100"),
        ([rec, part(100, 300)], "0 and 1 share 200"),
    ):
        with pytest.warns(mf.ModfunWarning, match=shared):
            assert shared in mf.fit(records, two, harmonics=12).check()
    with warnings.catch_warnings():
        warnings.simplefilter("error", mf.ModfunWarning)
        mf.fit([part(0, 257), part(256, 513)], two, harmonics=8)  # one sample at the seam
    both = mf.Record(y=np.vstack([rec.y, rec.y]), u=rec.u, dt=rec.dt)
    with pytest.warns(mf.ModfunWarning, match="'y1' and 'y2' are the same"):
        mf.fit(both, mf.TransferFunction(poles=2, zeros=0, denominator="common"), harmonics=12)


@pytest.mark.parametrize("method", ["ls", "wls"])
def test_one_shot_estimates_say_that_noise_biases_them(method):
    def checked(nsr: float) -> str:
        rec = mf.simulate(
            mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=nsr, seed=1
        )
        return str(mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), method=method, harmonics=12).check())

    assert f'method="{method}" is biased by noise' in checked(0.6)
    assert "is biased by noise" not in checked(0.001)


def test_intervals_refuse_what_has_no_meaning_and_keep_their_columns():
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=1
    )
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    with pytest.raises(mf.SpecError, match="between 0 and 1"):
        fit.interval(fit.params, fit.bse, level=2)
    with pytest.raises(mf.SpecError, match="not negative"):
        fit.interval(fit.params, -fit.bse)
    for level in (0.95, 1e-12, 1e-17):
        assert len(fit.table(level=level).columns) == 7
