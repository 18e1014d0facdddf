"""The bootstrap of several outputs, held and late parameters, coloured noise, masked samples."""

import modfun as mf
import numpy as np
import pytest
from modfun.inference.bootstrap_noise import jacobian_lines, wild

N, DT = 400, 0.05
T = DT * np.arange(N + 1)
U = np.array([np.sin(T**2 / 6), np.cos((20 - T) ** 2 / 5)])
SYSTEM = mf.tf([[[1.0, 2.0], [3.0]], [[0.5], [-1.0, 0.7]]], [1.0, 1.2, 4.0], delay=[0.0, 0.2])
ZEROS = [[1, 0], [0, 1]]
ROOT = np.array([[0.1, 0.0], [0.05, 0.02]])


def record(seed=0, root=ROOT, **words):
    y = SYSTEM.simulate(u=U, dt=DT) + root @ np.random.default_rng(seed).standard_normal((2, N + 1))
    return mf.Record(y=y, u=U, dt=DT, outputs=["al", "q"], inputs=["de", "da"], **words)


def structure(denominator="common", delay=(0.0, 0.2), **words):
    return mf.TransferFunction(poles=2, zeros=ZEROS, delay=list(delay), denominator=denominator, **words)


LATE = [0.0, mf.Free(0.1, min=0, max=0.5)]
CASES = {
    "common": structure(),
    "separate": structure("separate"),
    "held": structure(params={"a2": 4.0}),
    "late": structure(delay=LATE),
}


def line_covariance(fit, rec):
    """Classical covariance of the parameters from the columns on the lines, all else projected out."""
    (low, high), lead = fit.lines[0], rec.intervals - fit.intervals[0]
    clean = rec._like(y=fit.predict(rec).y)
    shared, own, _ = jacobian_lines(fit, clean, high, lead, fit.omega0[0])
    whiten = np.linalg.inv(np.linalg.cholesky(fit.noise_cov))
    scale = np.sqrt(2 * fit.intervals[0] / np.where(np.arange(high + 1) == 0, 2, 1))
    apart = [np.where(np.arange(2)[:, None] == i, column, 0) for column in own for i in range(2)]
    rows = [(whiten @ column * scale)[:, low:].ravel() for column in [*shared, *apart]]
    matrix = np.array([np.concatenate([row.real, row.imag]) for row in rows]).T
    size = np.linalg.norm(matrix, axis=0)
    kept = matrix[:, size > 0] / size[size > 0]
    inverse = np.linalg.pinv(kept.T @ kept, rcond=1e-14)
    p = len(shared)
    return inverse[:p, :p] / np.outer(size[:p], size[:p])


@pytest.mark.parametrize("case", CASES)
def test_the_columns_on_the_lines_give_the_covariance_of_the_fit(case):
    rec = record(1)
    fit = mf.fit(rec, CASES[case], band=6.0)
    # The columns are those of the response, the fit's own of the measured record: near, not the same.
    np.testing.assert_allclose(
        np.sqrt(np.diag(line_covariance(fit, rec))), np.sqrt(np.diag(fit.cov_nonrobust)), rtol=0.06
    )


@pytest.mark.statistics
@pytest.mark.parametrize("case", CASES)
def test_parametric_scatter_is_the_classical_standard_error(case):
    fit = mf.fit(record(2), CASES[case], cov_type="nonrobust", band=6.0)
    found = mf.bootstrap(fit, replicates=1500, seed=1)
    assert found.success.mean() > 0.99
    # First order in the noise leaves a few percent; beyond that four Monte Carlo errors, 35 numbers in all
    # cases: false alarm below 1 in 400 of seeds.
    assert np.all(np.abs(found.sd - fit.bse) < 4 * found.sd_mcse + 0.06 * fit.bse), found.sd / fit.bse
    assert found.param_names == fit.param_names


@pytest.mark.statistics
def test_wild_scatter_of_several_outputs_is_that_of_hc3():
    """Median ratio of 12 records, 8 numbers: it scatters by some 5 % from seed to seed; limits 20 %."""
    ratios = []
    for seed in range(12):
        fit = mf.fit(record(seed), structure(), band=6.0)
        found = mf.bootstrap(fit, replicates=200, seed=seed, kind="wild")
        ratios.append(found.sd / np.sqrt(np.diag(fit.cov_params("HC3"))))
    middle = np.median(ratios, axis=0)
    assert np.all((middle > 0.8) & (middle < 1.2)), middle


def test_wild_noise_keeps_the_correlation_of_the_outputs():
    fit = mf.fit(record(3), structure("separate"), band=6.0)
    rec = fit.records[0]
    draw = wild(fit, (rec,), [fit.simulate(rec)], 0)
    lead = rec.intervals - fit.intervals[0]
    one, two = (np.fft.rfft(e[:, lead:-1]) for e in draw(range(2))[0])
    np.testing.assert_allclose(np.abs(one), np.abs(two), atol=1e-10)
    cross = one[0, 1:-1] * one[1, 1:-1].conj()
    np.testing.assert_allclose(cross, two[0, 1:-1] * two[1, 1:-1].conj(), atol=1e-9)
    assert np.abs(np.angle(one[0, 1:-1] / two[0, 1:-1])).max() > 1


def test_separate_outputs_with_weights_apart_are_spread_as_each_alone():
    """With diagonal weights nothing joins the outputs, so neither may the leverage."""
    rec = record(4)
    both = mf.fit(rec, structure("separate"), band=6.0, output_weights=[1.0, 3.0])
    joint = wild(both, (rec,), [both.simulate(rec)], 5)(range(1))[0][0]
    for i, name in enumerate(["al", "q"]):
        own = rec.select(outputs=[name])
        alone = mf.fit(own, mf.TransferFunction(poles=2, zeros=ZEROS[i], delay=[0.0, 0.2]), band=6.0)
        e = wild(alone, (own,), [alone.simulate(own)], 5)(range(1))[0][0]
        np.testing.assert_allclose(joint[i], e[0], atol=1e-8 * np.abs(e).max())


def test_coloured_fits_take_the_wild_bootstrap():
    rng = np.random.default_rng(5)
    e = rng.standard_normal((1, 200 + N + 1))
    for k in range(1, e.shape[1]):
        e[:, k] += 0.95 * e[:, k - 1]
    one = mf.Record(y=record(root=0 * ROOT).y[:1] + 0.03 * e[:, 200:], u=U, dt=DT, inputs=["de", "da"])
    tf = mf.TransferFunction(poles=2, zeros=[1, 0], delay=[0.0, 0.2])
    fit = mf.fit(one, tf, noise="coloured", band=6.0)
    found = mf.bootstrap(fit, replicates=200)
    assert found.kind == "wild"
    assert np.all((found.sd > 0.6 * fit.bse) & (found.sd < 1.7 * fit.bse)), found.sd / fit.bse
    with pytest.raises(mf.SpecError, match="kind='wild', which assumes no colour"):
        mf.bootstrap(fit, kind="parametric")


def test_samples_of_unlike_sigma_are_drawn_and_refitted_so():
    fit = mf.fit(record(6, sigma=np.where(T > 12, 3.0, 1.0)), structure(), cov_type="nonrobust", band=6.0)
    found = mf.bootstrap(fit, replicates=60, seed=2)
    assert found.success.all()
    # A deviation of 60 has a standard error of 9 %: limits at 4 of them, 8 numbers, one seed in 2,000.
    assert np.all(np.abs(found.sd / fit.bse - 1) < 0.37), found.sd / fit.bse
    with pytest.raises(mf.DataError, match="unlike sigma; use kind='parametric'"):
        mf.bootstrap(fit, kind="wild")


def test_masked_samples_stay_masked_in_every_replicate():
    ok = (T < 5.0) | (T >= 5.5)
    one = record(6).select(outputs=["al"])
    tf = mf.TransferFunction(poles=2, zeros=[1, 0], delay=[0.0, 0.2])
    fit, whole = (mf.fit(rec, tf, cov_type="nonrobust", band=6.0) for rec in (one.weigh(mask=ok), one))
    found, other = (mf.bootstrap(own, replicates=60, seed=2) for own in (fit, whole))
    assert found.success.all()
    assert (found.params != other.params).all()
    # Over its level the noise is the same sample by sample: what the gap takes away shows, and no more.
    ratio = found.sd / other.sd * np.sqrt(whole.noise_cov[0, 0] / fit.noise_cov[0, 0])
    assert np.all((ratio > 0.97) & (ratio < 1.5)), ratio
    with pytest.raises(mf.DataError, match="10 masked samples; use kind='parametric'"):
        mf.bootstrap(fit, kind="wild")


@pytest.mark.parametrize("kind", ["parametric", "wild"])
@pytest.mark.parametrize("noise", ["errors-in-variables", mf.Noise(y=[0.1, 0.05], u=0.01)])
def test_noisy_inputs_are_refused(kind, noise):
    fit = mf.fit(record(7), structure(), noise=noise, band=6.0)
    with pytest.raises(mf.SpecError, match=r"noisy inputs.*MonteCarlo"):
        mf.bootstrap(fit, kind=kind)


def test_noise_that_was_given_is_drawn_or_refused():
    fit = mf.fit(record(8), structure(), noise=mf.Noise(y=ROOT @ ROOT.T), cov_type="nonrobust", band=6.0)
    found = mf.bootstrap(fit, replicates=400, seed=3)
    assert np.all(np.abs(found.sd / fit.bse - 1) < 0.2), found.sd / fit.bse
    shaped = mf.fit(record(8), structure(), noise=mf.Noise(y=lambda w: 1 / (1 + w**2)), band=6.0)
    with pytest.raises(mf.SpecError, match="noise given as spectra; use kind='wild'"):
        mf.bootstrap(shaped, kind="parametric")
