"""Poles and zeros that outputs share."""

import modfun as mf
import numpy as np
import pytest

N, DT = 600, 0.05
T = DT * np.arange(N + 1)
U = np.array([np.sin(T**2 / 9), np.cos((30 - T) ** 2 / 7)])


def fitted(den, seed=0, noise=0.02, poles=2):
    num = [[[1.0, 2.0], [3.0]], [[0.5, 1.0], [0.7]]]
    sys = mf.tf(num, [[den[0]] * 2, [den[1]] * 2])
    rng = np.random.default_rng(seed)
    y = sys.simulate(u=U, dt=DT) + noise * rng.standard_normal((2, N + 1))
    rec = mf.Record(y=y, u=U, dt=DT, outputs=["al", "q"], inputs=["de", "da"])
    tf = mf.TransferFunction(poles=poles, zeros=[[1, 0], [1, 0]], denominator="separate")
    return mf.fit(rec, tf, cov_type="nonrobust", band=6.0)


def test_one_denominator_is_found_and_not_objected_to():
    den = [1, 1.2, 4.0]
    found = mf.common_poles(fitted([den, den], seed=1))
    assert found.df == 2
    assert found.p_value > 0.01
    errors = np.sqrt(np.diag(found.cov))
    assert (np.abs(found.denominator - den[1:]) < 4 * errors).all()
    assert list(found.poles["outputs"]) == ["al, q"]
    assert abs(found.poles["pole"][0] - np.roots(den)[0]) < 0.05
    # The zero at -2 is that of both first paths.
    assert "al, q" in list(found.zeros["outputs"])
    assert "would spend fewer parameters" in str(found)


@pytest.mark.statistics
def test_the_test_has_its_size():
    """Under one denominator p-values are uniform: of 150 records at most 5 % + 4.5 errors below .05, and
    4.5 binomial standard errors about .5 below .5 (false alarm 1e-5 of seeds; HC and small samples aside)."""
    den = [1, 1.2, 4.0]
    p = np.array([mf.common_poles(fitted([den, den], seed=seed)).p_value for seed in range(150)])
    assert np.mean(p < 0.05) < 0.05 + 4.5 * np.sqrt(0.05 * 0.95 / 150)
    assert abs(np.mean(p < 0.5) - 0.5) < 4.5 * 0.5 / np.sqrt(150)


def test_other_denominators_are_objected_to():
    found = mf.common_poles(fitted([[1, 1.2, 4.0], [1, 1.2, 4.8]], seed=2))
    assert found.p_value < 1e-4
    assert "object to one denominator" in found.notes[0]
    assert sorted(found.poles["outputs"]) == ["al", "q"]


def test_a_shared_pole_among_others():
    """Real poles 1 and 4 of al, 1 and 2.5 of q: one shared."""
    found = mf.common_poles(fitted([[1, 5.0, 4.0], [1, 3.5, 2.5]], seed=3, noise=0.002))
    assert found.p_value < 1e-4
    table = dict(zip(np.round(np.abs(found.poles["pole"]), 1), found.poles["outputs"], strict=True))
    assert table == {1.0: "al, q", 2.5: "q", 4.0: "al"}


def test_what_it_takes():
    rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    with pytest.raises(mf.SpecError, match="separate"):
        mf.common_poles(fit)
    with pytest.raises(mf.SpecError, match="between 0 and 1"):
        mf.common_poles(fitted([[1, 1.2, 4.0]] * 2), level=2)
