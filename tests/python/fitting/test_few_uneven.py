"""Equations at few uneven times: a search goes on to least squares of the samples, as sums over them err."""

import modfun as mf
import numpy as np
import pytest

HOURS = np.array([0.1, 0.25, 0.5, 1, 2, 3, 4, 6, 8, 12])


def decay(seed=None, rate=0.3, size=5.0):
    """Ten samples of blood after a bolus, the last of which are as far apart as the time constant."""
    noise = 0.0 if seed is None else 0.08 * np.random.default_rng(seed).standard_normal(HOURS.size)
    return mf.Record(y=size * np.exp(-rate * HOURS) + noise, t=HOURS, outputs=["c"])


BOLUS = mf.Equation("c' = -ke*c", outputs=["c"])


@pytest.mark.parametrize("band", [None, 2.11])
def test_a_decay_at_ten_instants_is_what_output_error_says(band, tmp_path):
    """The rate was 0.69 on the default band, 0.54 on twice as much, which check() proposed."""
    assert mf.fit(decay(), BOLUS, band=band)["ke"] == pytest.approx(0.3, rel=1e-6)
    for seed in range(3):
        rec = decay(seed)
        fit = mf.fit(rec, BOLUS, band=band)
        assert fit["ke"] == pytest.approx(
            mf.rivals.output_error(BOLUS, start={"ke": 0.1})(rec)["ke"], rel=1e-3
        )
        assert "nothing wrong" in str(fit.check())
        assert "least squares of the response" in str(fit.summary())
    fit.save(tmp_path / "fit.json")
    assert "least squares of the response" in str(mf.load(tmp_path / "fit.json").summary())


def test_a_growth_is_found_from_where_sums_see_a_decay():
    """The rate was -0.68±0.35, for 0.2."""
    fit = mf.fit(decay(0, -0.2, 0.5), BOLUS)
    assert fit["ke"] == pytest.approx(-0.2, abs=0.02)
    assert 0.002 < fit.bse[0] < 0.01


def test_intervals_of_few_samples_hold_the_true_values():
    """Of 6 pairs of intervals fewer than 3 hold both once in 800 tests. The damping was 0.6, for 0.5."""
    t = np.array([0, 0.2, 0.4, 0.7, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 10, 12])
    clean, held = np.real(3 * np.exp((-0.25 + 1j) * t)), 0
    for seed in range(6):
        noise = 0.05 * np.random.default_rng(seed).standard_normal(t.size)
        fit = mf.fit(
            mf.Record(y=clean + noise, t=t, outputs=["c"]), mf.Equation("c'' = -a*c' - b*c", outputs=["c"])
        )
        limits = fit.conf_int()
        held += bool(np.all((limits[:, 0] < [0.5, 1.0625]) & (limits[:, 1] > [0.5, 1.0625])))
        assert np.all(np.abs(fit.params - [0.5, 1.0625]) < [0.06, 0.09])
    assert held >= 3


def test_growth_of_a_population_at_eleven_instants():
    """The rate was 0.99±0.2, for 0.7, and the limit 9.6."""
    t = np.array([0, 0.5, 1, 2, 3, 4, 5, 6, 8, 10, 12])
    y = 10 / (1 + 9 * np.exp(-0.7 * t)) + 0.15 * np.random.default_rng(1).standard_normal(t.size)
    fit = mf.fit(mf.Record(y=y, t=t, outputs=["y"]), mf.Equation("y' = r*y - q*y**2", outputs=["y"]))
    np.testing.assert_allclose(fit.params, [0.7, 0.07], rtol=0.1)


def test_a_response_that_the_lines_refute_takes_no_place_of_theirs(monkeypatch):
    """Least squares of the samples have no other level of noise that could say so."""
    from modfun.fitting import by_samples

    asked = []
    monkeypatch.setattr(by_samples, "sparse", lambda fit: asked.append(fit["ke"]) or "a doubt")
    assert mf.fit(decay(1), BOLUS)["ke"] > 0.6
    assert asked[0] == pytest.approx(0.3, abs=0.02)


def test_what_a_search_finds_is_no_advice_of_a_wider_band():
    """On twice the band a search went on to the samples, whose smaller errors no band has."""
    rng = np.random.default_rng(0)
    t = np.sort(np.r_[0, 20, rng.uniform(0, 20, 199)])
    noise = 0.05 * np.random.default_rng(99).standard_normal(t.size)
    rec = mf.Record(y=np.real(3 * np.exp((-0.25 + 1j) * t)) + noise, t=t, outputs=["c"])
    fit = mf.fit(rec, mf.Equation("c'' = -a*c' - b*c", outputs=["c"]))
    assert not fit.by_response
    assert "with band=" not in str(fit.check())


def test_a_search_that_ends_nowhere_says_what_needs_no_sums(monkeypatch):
    """Estimates of sums that err are not left without a word; the code that the warning names runs."""
    from modfun.fitting import by_samples

    monkeypatch.setattr(by_samples._Descent, "ended", lambda self: self.fit)
    monkeypatch.setattr("modfun.fitting.fit.by_response", lambda fit: fit)
    rec = decay(1)
    with pytest.warns(mf.ModfunWarning, match="Sums over the samples err") as found:
        fit = mf.fit(rec, BOLUS)
    code = "mf.rivals.output_error(model, start=dict(fit.params))(rec)"
    assert code in str(found[0].message)
    assert eval(code, {"mf": mf, "model": BOLUS, "fit": fit, "rec": rec})["ke"] == pytest.approx(
        0.3, abs=0.02
    )


INFUSION = mf.Equation("c' = u/V - ke*c", outputs=["c"], inputs=["u"])
EARLY = np.r_[np.arange(0, 4, 0.25), [4, 5, 6, 8, 10, 12.0]]
LATE = np.array([0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 10, 12, 16, 24])


def infused(hours, seed=0, sd=0.08):
    u = np.where(hours < 2, 50.0, 0.0)
    clean = INFUSION.model({"V": 20.0, "ke": 0.3}).simulate(u=u, t=hours, intersample="zoh")
    y = clean + sd * np.random.default_rng(seed).standard_normal(hours.size)
    return mf.Record(y=y, u=u, t=hours, outputs=["c"], intersample="zoh")


@pytest.mark.parametrize("start", ["unknown", "zero"])
@pytest.mark.parametrize("hours", [EARLY, LATE])
def test_held_inputs_at_few_times(hours, start):
    """V = 1064±750 and "nothing wrong", or ke = 2.2±0.3, from 22 samples without noise.

    Of a record or two sums have a right answer on fewer lines: rounding, and so the processor, decides which.
    """
    off, by_response = [], 0
    for seed in range(5):
        fit = mf.fit(infused(hours, seed), INFUSION, initial_state=start)
        by_response += fit.by_response
        off.append((fit.params - [20.0, 0.3]) / fit.bse)
    assert by_response >= 3
    # χ² with 10 degrees of freedom, nearly: beyond 29.6 in one of a thousand.
    assert np.sum(np.square(off)) < 29.6


def test_eleven_samples_from_zero_print():
    """A parabola through the first 12 samples was fitted to eleven, and print(fit) raised."""
    fit = mf.fit(infused(np.arange(11.0)), INFUSION, initial_state="zero")
    assert "V=19.81" in repr(fit)


UPTAKE = mf.Equation("S' = -V*S/(K + S)", outputs=["S"])


def used_up(seed):
    """Seventeen samples at chance times of what a saturated uptake, V = 1.2 and K = 0.6, leaves of 5."""
    rng = np.random.default_rng(seed)
    t = np.unique(np.r_[0, rng.uniform(0, 8, 16)].round(2))
    clean = UPTAKE.model({"V": 1.2, "K": 0.6}).simulate(t=t, initial_state=[5.0])
    return mf.Record(y=clean + 0.03 * rng.standard_normal(t.size), t=t, outputs=["S"])


def test_an_uptake_is_found_from_sizes_where_sums_see_a_pole():
    """K was -1.56±0.18 and "ok" in 5 of 12 records, and 4 took more than 25 s."""
    off = []
    for seed in range(6):
        fit = mf.fit(used_up(seed), UPTAKE)
        assert fit.by_response
        off.append((fit["K"] - 0.6) / fit.bse["K"])
    # χ² with 6 degrees of freedom, nearly: beyond 22.5 in one of a thousand.
    assert np.sum(np.square(off)) < 22.5


BOTH = mf.Equation(
    ["c' = u/V - (k10 + k12)*c + k21*p", "p' = k12*c - k21*p"],
    outputs=["c"],
    hidden=["p"],
    params={name: mf.Free(at, min=0.0) for name, at in {"V": 15, "k10": 0.2, "k12": 0.5, "k21": 0.4}.items()},
)
SPREAD = np.array([0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24])
COMPARTMENTS = {"V": 12.0, "k10": 0.3, "k12": 0.8, "k21": 0.5}


@pytest.mark.parametrize("noise", ["output", "log-normal"])
def test_two_compartments_from_zero(noise):
    """k12 was 0, its bound, in 10 of 10 records; noise in proportion to the level was refused."""
    u = np.where(SPREAD < 0.5, 200.0, 0.0)
    clean = BOTH.model(COMPARTMENTS).simulate(u=u, t=SPREAD, intersample="zoh")
    off = []
    for seed in range(6):
        e = np.random.default_rng(seed).standard_normal(SPREAD.size)
        y = clean * np.exp(0.05 * e) if noise == "log-normal" else clean + 0.1 * e
        rec = mf.Record(y=y, u=u, t=SPREAD, outputs=["c"], intersample="zoh")
        fit = mf.fit(rec, BOTH, initial_state="zero", noise=noise)
        assert fit.by_response
        assert fit.success
        off.append([(fit[name] - at) / fit.bse[name] for name, at in COMPARTMENTS.items()])
    # Mean squares of t with nine degrees of freedom are 1.29; of 24 correlated ones 4 is beyond 1 in 1000.
    assert np.mean(np.square(off)) < 4
