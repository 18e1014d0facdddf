"""What `Record.check` says of a record, and where it is silent."""

import modfun as mf
import numpy as np
import pytest
from modfun import Record
from scipy.integrate import solve_ivp
from two_signals import N, T, signals

Y, U = signals()


@pytest.fixture
def rec():
    return Record(y=Y, u=U, dt=0.02, outputs="q", inputs=["de"])


def said(words, **record):
    """Tell whether check() of a record has a sentence with these words."""
    return words in Record(**{"dt": 0.02, **record}).check()


def test_check_has_nothing_to_say_about_a_good_record(rec):
    assert list(rec.check()) == []


@pytest.mark.parametrize("at", [1, 20, 100])
def test_check_is_silent_on_the_response_to_a_step(at):
    u = (np.arange(300) >= at).astype(float)
    record = mf.simulate(
        mf.tf([3.0], [1.0, 1.2, 4.0]), input=u, duration=14.95, intervals=299, intersample="zoh"
    )
    noisy = record["y"] + 0.02 * np.random.default_rng(0).standard_normal(300)
    said = list(Record(y=noisy, u=u, dt=0.05).check())
    assert said == []


def test_check_held_input_declared_smooth():
    steps = np.sign(np.sin(2 * T + 0.1))
    (sentence,) = Record(y=Y, u=steps, dt=0.02, intersample="smooth").check()
    assert "holds its value over 494 of 500 steps" in sentence
    assert "intersample='zoh'" in sentence
    assert not Record(y=Y, u=steps, dt=0.02, intersample="zoh").check()
    assert said("intersample='zoh'", y=Y, u=np.repeat(signals(2)[0], 3)[: N + 1], intersample="smooth")


def test_check_straight_lines_and_smooth_input_declared_held():
    ramps = np.interp(T, [0, 1, 3, 4, 7, 10], [0, 2, -1, 0.5, 1.5, -2])
    assert said("intersample='foh'", y=Y, u=ramps, intersample="smooth")
    assert not Record(y=Y, u=ramps, dt=0.02, intersample="foh").check()
    assert said("give intersample='smooth'", y=Y, u=U, intersample="zoh")


def test_check_clipping():
    (sentence,) = Record(y=np.minimum(Y, 0.8), u=U, dt=0.02).check()
    assert "clipped" in sentence
    assert "largest value 0.8" in sentence
    (sentence,) = Record(y=np.maximum(Y, -0.8), u=U, dt=0.02).check()
    assert "smallest value -0.8" in sentence
    both = Record(y=np.clip(Y, -0.2, 0.2), u=U, dt=0.02)
    assert (np.abs(both.y) == 0.2).mean() > 0.6
    largest, smallest = (sentence for sentence in both.check() if "clipped" in sentence)
    assert "its largest value 0.2" in largest
    assert "its smallest value -0.2" in smallest
    assert not any("clipped" in sentence for sentence in Record(y=np.sign(Y), u=U, dt=0.02).check())


@pytest.mark.parametrize("step", [0.1, 0.05])
def test_tops_of_curves_in_coarse_steps_are_not_clipped(step):
    """In 20 of 20 records they were; clipped ones in such steps are still found."""
    t = 0.1 * np.arange(301)
    motion = lambda t, v: [v[0] - 0.5 * v[0] * v[1], 0.5 * v[0] * v[1] - v[1]]  # noqa: E731
    clean = solve_ivp(motion, (0, 30), [2, 1], t_eval=t, rtol=1e-8).y
    for seed in range(5):
        noise = 0.003 * clean.std() * np.random.default_rng(seed).standard_normal(clean.shape)
        y = clean + (noise if seed else 0)
        assert not any("clipped" in text for text in Record(y=np.round(y / step) * step, dt=0.1).check())
        y = np.round(y.clip(None, 3.3) / step) * step
        assert sum("its largest value 3.3" in text for text in Record(y=y, dt=0.1).check()) == 2


def test_check_angles_of_outputs_in_two_units():
    rec = Record(y=[Y, Y], u=U, dt=0.02, outputs=["alpha", "q"], units={"alpha": "deg", "q": "rad/s"})
    assert "Output 'alpha' is in deg and 'q' in rad/s" in list(rec.check())[-1]
    assert not any("unit of angle" in sentence for sentence in rec.convert(q="deg/s").check())


@pytest.mark.parametrize(("unit", "size"), [("deg", "smaller"), ("rad", "larger")])
def test_check_angles_of_an_input_in_another_unit_than_outputs(unit, size):
    """Derivatives were 57.3 times too small, which no residual shows."""
    units = {"alpha": "rad", "q": "rad/s"} if unit == "deg" else {"alpha": "deg", "q": "deg/s"}
    rec = Record(y=[Y, Y], u=U, dt=0.02, outputs=["alpha", "q"], inputs=["de"], units=units | {"de": unit})
    assert f"Input 'de' is in {unit}" in list(rec.check())[-1]
    assert f"57.3 times {size}" in list(rec.check())[-1]
    one = rec.convert(de="rad" if unit == "deg" else "deg")
    assert not any("57.3" in sentence for sentence in one.check())
    assert not any(
        "57.3" in sentence for sentence in rec.select(outputs=["q"]).assign(units={"q": "m"}).check()
    )


def test_check_steps_that_may_be_milliseconds():
    sentence = (
        "Steps of 20 are taken as seconds; if they are milliseconds, give dt=0.02, or the times in seconds."
    )
    assert not any("seconds" in text for text in Record(y=Y, u=U, dt=20).check())  # as it says
    assert sentence in list(Record(y=Y, u=U, t=20.0 * np.arange(Y.size)).check())
    for step in (1, 0.02, 2.5):
        times = step * np.arange(Y.size)
        assert not any("milliseconds" in sentence for sentence in Record(y=Y, u=U, t=times).check())


def test_check_codes_for_missing_values():
    coded = Y.copy()
    coded[[50, 51, 52, 300]] = -9999
    assert said("4 samples are exactly -9999", y=coded, u=U)
    assert said("rec.weigh(mask=rec['y'] != -9999)", y=coded, u=U)
    assert said("fill them in", y=Y, u=coded)
    steps = np.where(T > 5, 100.0, 0.0)  # two levels are a step
    assert not said("missing values", y=Y, u=steps)


def test_check_stale_samples():
    assert said("'y' has a new value only every 4th sample", y=np.repeat(Y[::4], 4)[: N + 1], u=U)
    uneven = np.repeat(Y[::4], np.resize([3, 5], Y[::4].size))[: N + 1]
    assert said("% of its samples repeat", y=uneven, u=U)
    frozen = Y.copy()
    frozen[100:160] = frozen[100]
    assert said("'y' is frozen: 60 samples from t = 2 s on are equal", y=frozen, u=U)


def test_check_constant_channels():
    assert said("no excitation", y=Y, u=np.zeros(N + 1))
    assert not said("initial_state", y=Y, u=np.zeros(N + 1))
    assert said("give initial_state='zero' to the fit", y=Y, u=np.ones(N + 1))
    assert said("says nothing", y=[Y, 0 * Y], u=U)


def test_check_noisy_outputs():
    noise = np.random.default_rng(0).standard_normal(N + 1)
    assert said("Output 'y' is noisy: standard deviation 0.5", y=np.sin(2 * T) + 0.5 * noise, u=U)
    assert not said("noisy", y=np.sin(2 * T) + 0.1 * noise, u=U)


def test_check_inputs_that_move_together():
    assert said("move together (correlation -1.000)", y=Y, u=[U, -3 * U])


def test_the_end_of_an_infusion_is_no_outlier():
    """28 of 60 such peaks were, where the input drops and the output begins to decay. Spikes still are."""
    t = np.arange(0, 24.5, 0.5)
    rest = np.maximum(t - 2, 0)
    y = 25 / 3 * (1 - np.exp(-0.3 * np.minimum(t, 2))) * np.exp(-0.3 * rest)
    for seed in range(20):
        noisy = y + 0.05 * np.random.default_rng(seed).standard_normal(t.size)
        u, spiked = np.where(t < 2, 50.0, 0.0), noisy + 2.0 * (t == 2)
        assert "outlying" not in str(mf.Record(y=noisy, u=u, t=t).check())
        assert "1 outlying sample, the first at t = 2 s" in str(mf.Record(y=spiked, u=u, t=t).check())


def test_check_outliers_and_where():
    spiked = Y.copy()
    spiked[[50, 300]] += 8.0
    assert said("2 outlying samples, the first at t = 1 s", y=spiked, u=U)
    lagged = np.zeros(N + 1)  # a doublet through a servo of 0.05 s bends at each edge
    for k in range(N):
        lagged[k + 1] = lagged[k] + 0.33 * ((50 <= k < 80) - (80 <= k < 110) - lagged[k])
    assert not said("outlying", y=Y, u=lagged)


def test_check_drift():
    assert said("drifts by", y=Y + 2 * T, u=U)
    assert not said("drifts by", y=np.exp(-T))  # the decay of free motion
    assert not list(Record(y=Y + 50, u=U, dt=T[1]).check())  # fits tell where a constant is missing


def test_check_gaps_and_uneven_steps():
    t = T.copy()
    t[250:] += 2.0
    assert said("1 gap, the longest of 2.02 at t = 4.98 where 0.02 is usual", y=Y, dt=None, t=t)
    t[250:] += 30.0
    assert not said("samples a period", y=Y, dt=None, t=t)  # of two runs, whose jump is no motion
    jitter = 0.005 * np.random.default_rng(0).uniform(-1, 1, N + 1)
    assert said("give dt=0.0199889 instead", y=Y, dt=None, t=T + jitter)


def test_check_short_slow_and_noisy_records():
    assert said("only 20 samples", y=Y[:20])
    assert said("short for its slow motion", y=np.sin(0.3 * T))
    assert said("samples a period", y=np.random.default_rng(0).standard_normal(N + 1))


@pytest.mark.parametrize("u", [np.zeros(8), np.arange(8.0), 1e150 * np.arange(8), 1e-150 * np.arange(8)])
def test_check_never_fails_on_odd_records(u):
    rng = np.random.default_rng(5)
    assert Record(y=rng.standard_normal(8), u=u, dt=1e-9).check()
    assert Record(y=u, t=np.cumsum(rng.uniform(1, 2, 8))).check()
