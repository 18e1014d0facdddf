"""Inputs of experiments: what they are made of, what takes them, and what is refused."""

import pickle

import modfun as mf
import numpy as np
import pytest
from modfun.signals.steps import TAPS, _sequence

EQ24 = mf.tf([5], [1, 3, 8])
SHORT_PERIOD = mf.ss([[-0.8, 1], [-4.5, -1.2]], [[-0.1], [-5.0]], np.eye(2))


# Multisines ------------------------------------------------------------------------------------------


def test_multisines_are_orthogonal_over_their_period_and_share_the_band():
    s = mf.signals.multisine(["de", "da", "dr"], band=(0.6, 12), duration=20, dt=0.02)
    gram = s.u[:, :-1] @ s.u[:, :-1].T
    sizes = np.sqrt(np.diag(gram))
    np.testing.assert_allclose(gram / np.outer(sizes, sizes), np.eye(3), atol=1e-12)
    lines = s.spectrum()
    base = 2 * np.pi / 20
    used = [np.flatnonzero(row > 1e-9) + 1 for row in lines.amplitude]
    wanted = np.arange(2, 39)  # 0.6 to 12 rad/s in units of .314
    for k, own in enumerate(used):
        np.testing.assert_array_equal(own, wanted[k::3])
        np.testing.assert_allclose(lines.amplitude[k, own - 1], lines.amplitude[k, own[0] - 1], rtol=1e-9)
    assert lines.omega[0] == pytest.approx(base)


@pytest.mark.parametrize(
    ("inputs", "band", "duration", "most"),
    [
        (["de"], (0.6, 12), 20, 1.01),
        (["de", "da"], (0.6, 12), 20, 1.01),
        (3, (0.6, 12), 20, 1.14),
        ("u", (0.6, 3.2), 10, 1.17),  # five lines
        (2, (0.3, 15), 40, 1.0),
        ("u", 3.2, 2, 1.0001),  # one line: a sine
    ],
)
def test_peak_factors_are_low(inputs, band, duration, most):
    s = mf.signals.multisine(inputs, band=band, duration=duration, dt=0.02)
    # By Schroeder's phases alone 1.16 to 1.32.
    assert np.all(s.peak_factor <= most)


def test_multisines_begin_and_end_at_zero_reach_their_amplitude_and_are_the_same_each_time():
    given = {"band": (1, 20), "duration": 14, "dt": 0.02, "amplitude": [2.0, -0.5], "before": 1, "after": 3}
    s = mf.signals.multisine(["a", "b"], **given)
    np.testing.assert_array_equal(s.u, mf.signals.multisine(["a", "b"], **given).u)
    assert np.all(s.u[:, s.t <= 1.0] == 0)
    assert np.all(s.u[:, s.t >= 11 - 1e-9] == 0)
    fine = s.resample(0.001)
    np.testing.assert_allclose(fine.peak, [2.0, 0.5], rtol=1e-3)
    assert np.all(fine.peak <= np.array([2.0, 0.5]) * (1 + 1e-3))
    np.testing.assert_allclose(fine.u[:, ::20], s.u, atol=1e-12)
    # Continuous at the ends: no step is larger than the rate times dt.
    assert np.all(fine.rate < 20 * fine.peak)
    assert s.intersample == ("smooth", "smooth")


@pytest.mark.parametrize("power", [lambda w: 1 / w, [1, 2, 3, 4], [1, 0, 0, 1]])
def test_power_is_as_asked(power):
    s = mf.signals.multisine("de", band=(1, 4), duration=2 * np.pi, dt=2 * np.pi / 256, power=power)
    wanted = power(np.arange(1.0, 5)) if callable(power) else np.array(power)
    found = s.spectrum().amplitude[0, :4] ** 2
    np.testing.assert_allclose(found / found.sum(), wanted / wanted.sum(), atol=1e-12)


# Sweeps ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sweep", ["linear", "logarithmic"])
@pytest.mark.parametrize("band", [(0.5, 12.0), (12.0, 0.5)])
def test_a_sweep_goes_from_one_frequency_to_the_other(sweep, band):
    s = mf.signals.chirp("de", band=band, duration=60, dt=0.001, amplitude=2.0, sweep=sweep, fade=0)
    u = s.u[0] / 2
    # cos of the phase, by the derivative over the frequency: u' = ω cos, so ω² = (u')²/(1 − u²).
    middle = np.abs(u[1:-1]) < 0.9
    omega = np.abs((u[2:] - u[:-2]) / 0.002 / np.sqrt(np.maximum(1 - u[1:-1] ** 2, 0.1)))
    share = s.t[1:-1] / 60
    course = {
        "linear": band[0] + (band[1] - band[0]) * share,
        "logarithmic": band[0] * (band[1] / band[0]) ** share,
    }[sweep]
    np.testing.assert_allclose(omega[middle], course[middle], rtol=2e-3)
    assert s.peak[0] == pytest.approx(2.0, abs=1e-5)


def test_a_sweep_fades_in_and_out():
    s = mf.signals.chirp("de", band=(0.5, 12), duration=66, dt=0.02, before=3, after=3, fade=4)
    assert np.all(s.u[0, (s.t <= 3) | (s.t >= 63 - 1e-9)] == 0)
    plain = mf.signals.chirp("de", band=(0.5, 12), duration=66, dt=0.02, before=3, after=3, fade=0)
    inside = (s.t >= 7) & (s.t <= 59)
    np.testing.assert_array_equal(s.u[0, inside], plain.u[0, inside])
    assert np.all(np.abs(s.u) <= np.abs(plain.u))


# Steps ---------------------------------------------------------------------------------------------------


def test_widths_of_a_multistep_are_exact():
    s = mf.signals.multistep("de", [3, 2, 1, 1], unit=0.3, dt=0.02, amplitude=-2, before=1, duration=10)
    assert s.duration == pytest.approx(10)
    starts = np.flatnonzero(np.diff(s.u[0])) + 1
    np.testing.assert_allclose(starts * 0.02, 1 + 0.3 * np.array([0, 3, 5, 6, 7]), atol=1e-12)
    np.testing.assert_array_equal(s.u[0, starts], [-2, 2, -2, 2, 0])
    assert s.energy[0] == pytest.approx(4 * 7 * 0.3)
    assert s.rms[0] == pytest.approx(2.0)
    assert s.peak_factor[0] == pytest.approx(1 / np.sqrt(2))
    assert s.intersample == ("zoh",)
    own = mf.signals.multistep("de", [2, 1], unit=0.1, dt=0.1, amplitude=[1.0, 0.5])
    np.testing.assert_array_equal(own.u, [[1, 1, -0.5, 0]])


def energy_density(s, omega):
    """|∫u e^(−iωt) dt|² of a held signal, by its steps: independent of the module."""
    steps = np.diff(s.u[0], prepend=0.0)
    return np.abs(np.exp(-1j * np.multiply.outer(omega, s.t)) @ steps / omega) ** 2


def test_a_mode_lies_where_a_doublet_has_most_energy_and_in_the_middle_of_a_3211():
    omega = np.linspace(0.05, 15, 6001)
    doublet = energy_density(mf.signals.doublet("de", omega=3.0, dt=0.001), omega)
    assert omega[doublet.argmax()] == pytest.approx(3.0, rel=2e-3)
    four = energy_density(mf.signals.multistep("de", omega=3.0, dt=0.001), omega)
    half = omega[four >= four.max() / 2]
    unit = np.pi / 6
    assert half.min() * unit == pytest.approx(0.28, abs=0.01)
    assert half.max() * unit == pytest.approx(2.65, abs=0.01)
    assert np.all(np.diff(half) < 0.01), "one band without gaps"


def test_a_rate_makes_ramps():
    s = mf.signals.multistep("de", [2, 1], unit=1.0, dt=0.1, rate=5.0, before=0.5, after=1.0, amplitude=2.0)
    assert s.intersample == ("foh",)
    assert s.rate[0] == pytest.approx(5.0)
    np.testing.assert_allclose(s.u[0, 5:10], [0, 0.5, 1, 1.5, 2])
    assert s.u[0, -1] == 0
    odd = mf.signals.doublet("de", width=1.0, dt=0.1, rate=8.0, after=1.0)
    assert set(np.round(odd.u[0], 12)) == {0.0, 0.8, 1.0, 0.2, -0.6, -1.0, -0.2}


@pytest.mark.parametrize("order", [n for n in TAPS if n <= 14])
def test_binary_sequences_have_the_longest_period_and_a_flat_spectrum(order):
    length = 2**order - 1
    bits = _sequence(order, 0)
    assert abs(bits.sum()) == 1
    power = np.abs(np.fft.fft(bits)) ** 2
    np.testing.assert_allclose(power[1:], length + 1, rtol=1e-9)  # so no shorter period


@pytest.mark.parametrize("order", [n for n in TAPS if n > 14])
def test_long_registers_have_primitive_polynomials(order):
    # x^(2^n) = x, and x^((2^n − 1)/p) is not 1 for any prime factor p.
    poly = sum(1 << tap for tap in TAPS[order]) | 1

    def times(a, b):
        found = 0
        while b:
            found ^= a if b & 1 else 0
            b, a = b >> 1, a << 1
            a ^= poly if a >> order else 0
        return found

    def power(k):
        found, base = 1, 2
        while k:
            found = times(found, base) if k & 1 else found
            base, k = times(base, base), k >> 1
        return found

    whole = 2**order - 1
    primes = [p for p in range(2, whole) if whole % p == 0 and all(p % q for q in range(2, int(p**0.5) + 1))][
        :9
    ]
    assert power(whole) == 1
    assert all(power(whole // p) != 1 for p in primes)


def test_a_binary_sequence_covers_its_band():
    s = mf.signals.prbs("de", band=(0.5, 10), dt=0.02, amplitude=3.0)
    assert s.duration == pytest.approx(63 * 0.26)
    assert np.all(np.abs(s.u[0, :-1]) == 3)
    lines = s.spectrum()
    clock = 0.26
    held = np.abs(np.sinc(lines.omega * clock / 2 / np.pi))
    np.testing.assert_allclose(lines.amplitude[0], 2 * 3 * 8 / 63 * held, atol=1e-9)
    assert lines.omega[0] <= 0.5
    assert np.sinc(10 * clock / 2 / np.pi) ** 2 >= 0.5
    other = mf.signals.prbs("de", band=(0.5, 10), dt=0.02, amplitude=3.0, seed=4)
    assert not np.array_equal(other.u, s.u)
    np.testing.assert_allclose(other.spectrum().amplitude, lines.amplitude, atol=1e-9)
    cut = mf.signals.prbs("de", band=10, dt=0.02, duration=20, before=1, after=2)
    assert cut.duration == pytest.approx(20)
    twice = mf.signals.prbs("de", clock=0.26, dt=0.02, duration=2 * 0.26 * 63)
    np.testing.assert_array_equal(twice.u[0, : 63 * 13], twice.u[0, 63 * 13 : -1])


# What can be made of them --------------------------------------------------------------------------------


def test_one_after_the_other():
    first = mf.signals.doublet("da", width=0.5, dt=0.1, before=0.5, after=1.0)
    then = mf.signals.multisine("dr", band=(2, 8), duration=4, dt=0.1)
    both = first.then(then)
    assert both.inputs == ("da", "dr")
    assert both.intersample == ("zoh", "smooth")
    assert both.duration == pytest.approx(first.duration + 4)
    np.testing.assert_array_equal(both.u[0, : first.u.shape[1]], first.u[0])
    np.testing.assert_array_equal(both.u[1, first.intervals :], then.u[0])
    np.testing.assert_allclose(both.functions[1](both.t), both.u[1], atol=1e-12)
    again = first.then(first)
    np.testing.assert_array_equal(again.u[0], np.append(first.u[0, :-1], first.u[0]))


def test_other_amplitudes():
    s = mf.signals.multisine(["de", "da"], band=(1, 8), duration=10, dt=0.1)
    twice = s.scaled([2.0, -0.5])
    np.testing.assert_array_equal(twice.u, [[2.0], [-0.5]] * s.u)
    np.testing.assert_allclose(twice.resample(0.05).u[:, ::2], twice.u, atol=1e-12)
    np.testing.assert_allclose(twice.peak_factor, s.peak_factor)
    with pytest.raises(mf.SpecError, match=r"factor=\[1, 2, 3\] must be one number"):
        s.scaled([1, 2, 3])


def test_resampling_keeps_what_happens_when():
    s = mf.signals.multistep("de", [3, 2, 1, 1], unit=0.3, dt=0.1, before=0.5, after=1.0)
    fine = s.resample(0.02)
    y = EQ24.simulate(u=s)
    np.testing.assert_allclose(EQ24.simulate(u=fine)[::5], y, atol=1e-12)
    ramp = mf.signals.doublet("de", width=1.0, dt=0.1, rate=5.0, after=1.0)
    np.testing.assert_allclose(EQ24.simulate(u=ramp.resample(0.05))[::2], EQ24.simulate(u=ramp), atol=1e-12)
    with pytest.raises(mf.SpecError, match=r"changes at 0.5 s, no sample at dt=0.15 s"):
        s.resample(0.15)
    with pytest.raises(mf.SpecError, match="known by smooth samples only"):
        mf.signals.Signals(np.sin(s.t), 0.1, "de", "smooth").resample(0.05)


def test_files_tables_pickles_and_plots(tmp_path):
    s = mf.signals.multisine(["de", "da"], band=(1, 8), duration=10, dt=0.1, amplitude=[2, 1])
    s.to_csv(tmp_path / "inputs.csv")
    rec = mf.read(tmp_path / "inputs.csv", time="t", outputs=["da"], inputs=["de"])
    np.testing.assert_allclose(rec.u[0], s.u[0], atol=1e-9)
    assert rec.dt == pytest.approx(0.1)
    again = pickle.loads(pickle.dumps(s))
    np.testing.assert_array_equal(again.u, s.u)
    assert again.inputs == s.inputs
    table = s.to_table()
    assert table["input"].tolist() == ["de", "da"]
    assert "peak_factor" in repr(s)
    assert "<table" in s._repr_html_()
    measured = mf.Record(np.zeros(101), s, outputs="q")
    assert (measured.inputs, measured.intersample, measured.dt) == (s.inputs, s.intersample, 0.1)
    np.testing.assert_array_equal(measured.u, s.u)
    held = mf.signals.doublet("de", width=0.5, dt=0.1, after=1.0)
    other = mf.Record(y=np.zeros((21, 1)), u=held, axis=0)
    assert (other.inputs, other.intersample, other.dt) == (("de",), ("zoh",), 0.1)
    import matplotlib

    matplotlib.use("Agg")
    assert len(s.plot()) == 2
    s.spectrum().plot()


# What takes them -----------------------------------------------------------------------------------------


def test_simulate_takes_names_sampling_and_form_from_signals():
    s = mf.signals.multisine("de", band=(0.6, 12), duration=20, dt=0.02)
    rec = mf.simulate(EQ24, input=s)
    assert (rec.inputs, rec.intersample, rec.intervals) == (("de",), ("smooth",), 1000)
    assert rec.dt == pytest.approx(0.02)
    # Exact between the samples: the steady response to each line and the transient of rest.
    wide = mf.simulate(EQ24, input=s.resample(0.1))
    np.testing.assert_allclose(wide.y, rec.y[:, ::5], atol=1e-11)
    held = mf.signals.doublet("de", width=0.5, dt=0.1, after=2.0)
    rec = mf.simulate(SHORT_PERIOD, input=held, outputs=["alpha", "q"], duration=3.0)
    np.testing.assert_array_equal(rec.y, SHORT_PERIOD.simulate(u=held.u, dt=0.1, intersample="zoh"))
    assert rec.intersample == ("zoh",)
    np.testing.assert_array_equal(SHORT_PERIOD.simulate(u=held), rec.y)


def test_inputs_of_equations_are_found_by_name():
    m = mf.Equation("y'' + a*y' + b*y = c*de + d*da", outputs=["y"], inputs=["de", "da"])
    m = m.model({"a": 1.0, "b": 2.0, "c": 3.0, "d": 4.0})
    s = mf.signals.multisine(["da", "de"], band=(1, 8), duration=10, dt=0.1)
    swapped = mf.signals.Signals(s.u[::-1], 0.1, ["de", "da"], "smooth", s.functions[::-1])
    np.testing.assert_allclose(m.simulate(u=s), m.simulate(u=swapped), atol=1e-12)
    assert mf.simulate(m, input=s).inputs == ("de", "da")
    with pytest.raises(mf.SpecError, match="the signals are de, dr, the inputs of the system de, da"):
        mf.simulate(m, input=mf.signals.Signals(s.u, 0.1, ["de", "dr"], "smooth"))


def test_a_study_over_signals_of_their_own_lengths():
    inputs = {
        "doublet": mf.signals.doublet("de", omega=2.8, dt=0.05, after=8.0),
        "multisine": mf.signals.multisine("de", band=(0.6, 8), duration=15, dt=0.05),
    }
    study = mf.MonteCarlo(system=EQ24, input=inputs, nsr=0.05, estimators=["ml"], harmonics=10, replicates=64)
    res = study.run()
    assert res.axes["input"] == ("doublet", "multisine")
    rec, _ = res.replicate(3, input="doublet")
    assert (rec.inputs, rec.intersample) == (("de",), ("zoh",))
    assert rec.intervals == inputs["doublet"].intervals
    alone = mf.simulate(EQ24, input=inputs["doublet"], nsr=0.05, seed=0, replicate=3)
    np.testing.assert_array_equal(rec.u, alone.u)
    # A relative sd of 64 replicates errs by 9 %; the bound may not be passed by more than four of these.
    assert np.all(res.sd > 0.64 * res.crlb)


def test_delay_systems_take_signals():
    plant = mf.timelag.DelaySystem(A={0: [[-1.0]], 1.0: [[-0.5]]}, B={0.4: [[1.0]]})
    s = mf.signals.doublet("u", width=1.0, dt=0.1, after=3.0)
    rec = mf.simulate(plant, input=s)
    other = mf.simulate(plant, input=s.u, duration=5.0, intervals=50, intersample="zoh")
    np.testing.assert_array_equal(rec.y, other.y)
    np.testing.assert_allclose(plant.simulate(duration=5.0, dt=0.1, u=s).y, rec.y, atol=1e-9)


# What is refused -----------------------------------------------------------------------------------------

BASE = {"band": (0.6, 12), "duration": 20, "dt": 0.02}


@pytest.mark.parametrize(
    ("make", "options", "said"),
    [
        ("multisine", {"dt": 0}, "dt=0 must be a number above 0"),
        ("multisine", {"dt": "fast"}, "dt='fast' must be a number"),
        ("multisine", {"duration": 20.01}, "whole number of them: give 20.02 s"),
        ("multisine", {"duration": np.inf}, "must be a number"),
        ("multisine", {"duration": 1e9}, "too many"),
        ("multisine", {"inputs": ["a", "a"]}, "twice"),
        ("multisine", {"inputs": []}, "give a name"),
        ("multisine", {"inputs": 0}, "1 to 100"),
        ("multisine", {"inputs": 40}, "holds 37 multiples"),
        ("multisine", {"band": (12, 0.6)}, "0 ≤ lower < upper"),
        ("multisine", {"band": (1, 2, 3)}, "0 ≤ lower < upper"),
        ("multisine", {"band": 200}, "samples 0.02 s apart end at 157.1"),
        ("multisine", {"amplitude": 0}, "not 0"),
        ("multisine", {"amplitude": [1, 2, 3]}, "not 0"),
        ("multisine", {"power": [1, 2]}, "37 finite numbers"),
        ("multisine", {"power": lambda w: -w}, "37 finite numbers"),
        ("multisine", {"power": np.zeros(37)}, "gives the lines of 'u' none"),
        ("multisine", {"before": 10, "after": 10}, "leave 0 s of duration=20 s"),
        ("multisine", {"before": -1}, "of at least 0"),
        ("chirp", {"band": 12}, "(first, last)"),
        ("chirp", {"band": (0, 12)}, "no first octave"),
        ("chirp", {"sweep": "quadratic"}, "'logarithmic' or 'linear'"),
        ("chirp", {"fade": 11}, "at most a half"),
        ("chirp", {"input": ["a", "b"]}, "one input at a time"),
        ("prbs", {"clock": 0.1}, "one of them"),
        ("prbs", {"band": (1, 150)}, "shorter than dt"),
        ("prbs", {"seed": -1}, "seed=-1"),
        ("prbs", {"band": (1e-5, 150), "dt": 0.01}, r"2\^20"),
        ("prbs", {"rate": 1.0}, "lengthen the pulses"),
    ],
)
def test_refused_arguments(make, options, said):
    with pytest.raises(mf.SpecError, match=said):
        getattr(mf.signals, make)(**{**BASE, **options})


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "unit= in s, or omega="),
        ({"unit": 0.3, "omega": 3}, "one of them"),
        ({"unit": 0.3, "pulses": [1, 0.5]}, "a pulse of 0.5 units=0.15 s is 1.5 sampling intervals"),
        ({"unit": 0.3, "pulses": []}, "widths above 0"),
        ({"unit": 0.3, "pulses": "3211"}, "widths above 0"),
        ({"unit": 0.3, "pulses": [3, -1]}, "widths above 0"),
        ({"unit": 0.3, "duration": 2.0}, "the pulses last 2.1 s, and duration=2 s leaves 2 s"),
        ({"unit": 0.3, "duration": 5.0, "after": 1.0}, "after= or duration="),
        ({"unit": 0.3, "rate": 1.0}, "takes 2 s, the shortest pulse lasts 0.3 s"),
        ({"unit": 0.3, "rate": 10.0}, "give after= at least 0.1 s"),
        ({"unit": 0.3, "amplitude": [1, 2]}, "or 4 of them"),
    ],
)
def test_refused_multisteps(options, said):
    with pytest.raises(mf.SpecError, match=said):
        mf.signals.multistep("de", **{"dt": 0.1, **options})


def test_what_disagrees_with_signals_is_refused():
    s = mf.signals.doublet("de", width=0.5, dt=0.1, after=2.0)
    for given, said in (
        ({"duration": 10.0}, "duration=10.0, the signals have 3; leave duration= out"),
        ({"intervals": 60}, "intervals=60, the signals have 30"),
        ({"intersample": "smooth"}, "leave intersample= out"),
    ):
        with pytest.raises(mf.SpecError, match=said):
            mf.simulate(EQ24, input=s, **given)
        with pytest.raises(mf.SpecError, match=said):
            mf.MonteCarlo(system=EQ24, input=s, estimators=["ls"], **given)
    with pytest.raises(mf.SpecError, match=r"dt=0\.2, the signals have 0.1"):
        EQ24.simulate(u=s, dt=0.2)
    with pytest.raises(mf.SpecError, match=r"1 signal.* for a system with 2 input"):
        mf.simulate(mf.tf([[5], [1]], [1, 3, 8]), input=s)
    with pytest.raises(mf.SpecError, match="duration= in s and intervals="):
        mf.simulate(EQ24, input="sin(t)")
    with pytest.raises(mf.SpecError, match="make both at one dt"):
        s.then(s.resample(0.05))
    with pytest.raises(mf.SpecError, match="goes smooth and zoh between samples"):
        s.then(mf.signals.multisine("de", band=(2, 8), duration=4, dt=0.1))
    with pytest.raises(mf.SpecError, match=r"a list with mf.signals in it; give Signals alone"):
        mf.simulate(EQ24, input=[s], duration=3.0, intervals=30)
    with pytest.raises(mf.DataError, match="is text; give real numbers"):
        mf.signals.Signals("sin(t)", 0.1)
    with pytest.raises(mf.DataError, match=r"give u\.T"):
        mf.signals.Signals(np.zeros((30, 2)), 0.1)
    with pytest.raises(mf.DataError, match="finite samples"):
        mf.signals.Signals([0.0, np.nan], 0.1)
    with pytest.raises(mf.SpecError, match="rows of u"):
        mf.signals.Signals(np.zeros((2, 9)), 0.1, ["a", "b"], ["zoh", "hold", "foh"])


def lateral():
    pytest.importorskip("sympy")
    model = mf.StateSpace(
        [["Lp", 0], [0, "Nr"]], [["Lda", "Ldr"], ["Nda", "Ndr"]], states=["p", "r"], inputs=["da", "dr"]
    )
    return model, {"Lp": -2.0, "Nr": -0.5, "Lda": -10.0, "Ldr": 1.5, "Nda": 0.3, "Ndr": -2.0}


def test_signals_go_to_the_inputs_of_their_names():
    """Of a state space with numbers too, in whatever order they stand."""
    model, values = lateral()
    system = model.model(values)
    signals = mf.signals.multisine(["dr", "da"], band=(0.6, 6), duration=20, dt=0.02)
    rec = mf.simulate(system, input=signals, outputs=["p", "r"])
    assert rec.inputs == ("da", "dr")
    np.testing.assert_array_equal(rec["dr"], signals.u[0])
    by_place = system.simulate(u=signals.u[::-1], dt=0.02)
    np.testing.assert_allclose(rec.y, by_place, atol=1e-4 * np.abs(by_place).max())
    np.testing.assert_allclose(system.simulate(u=signals), rec.y, rtol=1e-12, atol=1e-12)
    with pytest.raises(mf.SpecError, match="name the signals so"):
        mf.simulate(system, input=mf.signals.multisine(["x", "da"], band=(0.6, 6), duration=20, dt=0.02))
    of_names, of_places = (
        mf.crlb(system, mf.signals.Signals(signals.u[rows], 0.02, names, "smooth"), nsr=0.1).sd
        for rows, names in (([0, 1], ["dr", "da"]), ([1, 0], ["da", "dr"]))
    )
    np.testing.assert_allclose(of_names, of_places, rtol=1e-9)


@pytest.mark.parametrize(
    ("beside", "words"),
    [
        ({"dt": 0.01}, "dt= beside signals"),
        ({"t": np.arange(801) * 0.02}, "t= beside signals"),
        ({"inputs": "x"}, "inputs= beside signals"),
        ({"intersample": "zoh"}, "beside signals that are smooth"),
    ],
)
def test_what_signals_bring_is_not_said_twice(beside, words):
    de = mf.signals.multisine("de", band=(0.8, 4.7), duration=16, dt=0.02)
    with pytest.raises(mf.SpecError, match=words):
        mf.Record(y=de.u, u=de, **beside)


def test_smooth_signals_are_not_sampled_too_slowly():
    fast = mf.signals.multisine("de", band=(0.6, 40), duration=20, dt=0.01)
    with pytest.raises(mf.SpecError, match="of its energy above half the rate"):
        fast.resample(0.25)
    assert fast.resample(0.05).intervals == 400


def test_a_sequence_that_never_changes_is_refused():
    with pytest.raises(mf.SpecError, match="never changes"):
        mf.signals.prbs("u", dt=0.02, clock=20, duration=10)
    with pytest.raises(mf.SpecError, match="never changes"):
        mf.signals.prbs("u", band=(0.5, 10), dt=0.02, duration=0.1)
