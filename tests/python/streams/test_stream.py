"""`mf.Stream`: at any moment what a batch fit of the window says, however many samples went through."""

import copy
import itertools
import pickle
import signal
import threading
import warnings

import modfun as mf
import numpy as np
import pytest

TF2 = mf.TransferFunction(poles=2, zeros=0)
DT = 0.02


def drive(count, seed=0):
    """Smooth and rich enough for every window: six tones that never repeat together."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(count)
    omega = np.array([0.6, 1.3, 2.1, 3.3, 4.7, 6.1])
    return np.sin(omega[:, None] * t + rng.uniform(0, 6, (6, 1))).sum(axis=0) / 2


def simulated(system, count=2001, seed=0, nsr=0.1, **names):
    u = np.stack([drive(count, seed + k) for k in range(system.shape[1])])
    return mf.simulate(
        system, input=u, duration=DT * (count - 1), intervals=count - 1, nsr=nsr, seed=seed, **names
    )


def stream(**words):
    """A stream of the model most tests take, with a window of 8 s."""
    return mf.Stream(mf.Estimator(TF2, band=9.0), dt=DT, window=8.0, **words)


def quiet(*arguments, **words):
    """A fit without its warnings, which are not the matter here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        return mf.fit(*arguments, **words)


ONE = mf.tf([5], [1, 3, 8])
LATE = mf.tf([0.7, 5], [1, 3, 8], delay=0.05)
TWO = mf.tf([[[1, 2], [3]], [[0.5], [-1, 0.7]]], [1, 1.2, 4])
CASES = {
    "ml": (ONE, TF2, {"harmonics": 28}, "smooth"),
    "awls": (ONE, TF2, {"method": "awls", "band": 9.0}, "smooth"),
    "ls of the report": (
        ONE,
        TF2,
        {"method": "ls", "harmonics": 6, "rule": "staircase", "extended": False, "trend": None},
        "smooth",
    ),
    "wls, drift": (ONE, TF2, {"method": "wls", "band": (0.5, 9.0), "trend": "linear"}, "smooth"),
    "many lines": (ONE, TF2, {"band": 60.0}, "smooth"),
    "held input": (ONE, TF2, {"band": 9.0}, "zoh"),
    "straight input, delay": (LATE, mf.TransferFunction(poles=2, delay=0.05), {"band": 9.0}, "foh"),
    "smooth input, delay": (LATE, mf.TransferFunction(poles=2, delay=0.05), {"band": 9.0}, "smooth"),
    "bounds": (
        ONE,
        mf.TransferFunction(poles=2, zeros=0, params={"a2": mf.Free(min=0)}),
        {"band": 9.0},
        "smooth",
    ),
    "several outputs": (
        TWO,
        mf.TransferFunction(poles=2, zeros=[[1, 0], [0, 1]], denominator="common"),
        {"band": 9.0},
        "smooth",
    ),
    "known noise": (
        TWO,
        mf.TransferFunction(poles=2, zeros=[[1, 0], [0, 1]], denominator="common"),
        {"band": 9.0, "noise": mf.Noise(y=[0.1, 0.2])},
        "smooth",
    ),
    "delay to be found": (
        LATE,
        mf.TransferFunction(poles=2, delay=mf.Free(0.1, max=0.2)),
        {"band": 9.0},
        "smooth",
    ),
    "coloured": (ONE, TF2, {"band": 9.0, "noise": "coloured"}, "smooth"),
    "equation": (ONE, mf.Equation("y'' + a1*y' + a2*y = b0*u"), {"band": 9.0}, "smooth"),
}


@pytest.mark.parametrize("case", CASES)
def test_at_any_moment_it_is_the_fit_of_its_window(case):
    """To 1e-9, by parameters and standard errors; blocks of any size and single samples alike."""
    system, model, options, intersample = CASES[case]
    names = {} if system.shape == (1, 1) else {"outputs": ["a", "b"], "inputs": ["c", "d"]}
    rec = simulated(system, **names)
    if case == "equation":
        pytest.importorskip("sympy")
    est = mf.Estimator(model, **options)
    live = mf.Stream(est, dt=DT, window=8.0, intersample=intersample, **names)
    cuts = [0, 1, 2, 90, 451, 452, 1007, 1999, 2001]
    moments = 0
    for begin, end in itertools.pairwise(cuts):
        live.push(rec.y[:, begin:end], rec.u[:, begin:end])
        if not live.ready:
            continue
        moments += 1
        samples = live.record().y.shape[1]
        assert live.t == pytest.approx(DT * (end - 1))
        window = mf.Record(
            y=rec.y[:, end - samples : end],
            u=rec.u[:, end - samples : end],
            dt=DT,
            intersample=intersample,
            **names,
        )
        batch = quiet(window, model, **options)
        assert batch.success
        fit = live.fit()
        np.testing.assert_allclose(fit.params, batch.params, rtol=1e-9)
        np.testing.assert_allclose(fit.bse, batch.bse, rtol=1e-8)
        np.testing.assert_allclose(live.params, batch.params, rtol=1e-9)
        np.testing.assert_allclose(live.bse, batch.bse, rtol=1e-8)
        assert live.status == "ok"
        assert fit.lines == batch.lines
        assert fit.score()["r2"][0] > 0.9
    assert moments == 5


@pytest.mark.parametrize("model", ["one output", "two outputs"])
def test_forgetting_is_a_fit_of_windows_with_weights(model):
    """A window multiplied by c counts c² in the sum of squares: the same problem as its records so scaled."""
    system, structure, options, _ = CASES["ml" if model == "one output" else "several outputs"]
    names = {} if system.shape == (1, 1) else {"outputs": ["a", "b"], "inputs": ["c", "d"]}
    rec = simulated(system, 3001, **names)
    live = mf.Stream(mf.Estimator(structure, **options), dt=DT, window=8.0, forgetting=9.0, **names)
    assert live.weights == pytest.approx(np.exp(-8.0 / 9.0 * np.arange(6)))
    for end, windows in ((420, 1), (1100, 2), (2801, 7), (3001, 7)):
        live.push(rec.y[:, live.count : end], rec.u[:, live.count : end])
        windows = min(windows, 6)
        scaled = [
            mf.Record(y=c * rec.y[:, at - 401 : at], u=c * rec.u[:, at - 401 : at], dt=DT, **names)
            for c, at in zip(np.sqrt(live.weights), range(end, end - 400 * windows, -400), strict=False)
        ]
        fit = live.fit()
        # Records would have levels of their own; windows count as their weights say.
        batch = quiet(scaled, structure, **options, noise=mf.Noise(y=fit.noise_cov))
        assert len(fit.lines) == windows
        np.testing.assert_allclose(fit.params, batch.params, rtol=1e-7)
        np.testing.assert_allclose(fit.cov_hc3, batch.cov_hc3, rtol=1e-5, atol=1e-9)
    # With all windows behind it, it knows more than the last one alone.
    alone = quiet(live.record(), structure, **options)
    assert np.all(live.bse < alone.bse)


def test_following_is_pushing_and_asking():
    """Eight moments at once, as `follow` takes them, have the numbers of one by one."""
    rec = simulated(ONE)
    est = mf.Estimator(TF2, band=9.0)
    live, other = mf.Stream(est, dt=DT, window=8.0), mf.Stream(est, dt=DT, window=8.0)
    track = live.follow(rec, every=37)
    assert len(track) == sum(1 for k in range(401, 2002) if k % 37 == 0)
    assert set(track.status) == {"ok"}
    for t, params, bse in zip(track.t, track.params, track.bse, strict=True):
        end = round(t / DT) + 1
        other.push(rec.y[:, other.count : end], rec.u[:, other.count : end])
        np.testing.assert_allclose(other.params, params, rtol=1e-9)
        np.testing.assert_allclose(other.bse, bse, rtol=1e-8)
    table = track.table()
    assert table.columns == ("t", "a1", "a1_bse", "a2", "a2_bse", "b0", "b0_bse", "status")
    np.testing.assert_array_equal(track["a2"], table["a2"])
    assert "at last a1=" in repr(track)


def test_a_jump_is_followed_within_one_window():
    """a2 from 8 to 12 at 40 s: one window later the estimate is that of the new system."""
    u = drive(4001)
    before = mf.tf([5], [1, 3, 8]).simulate(u=u[:2001], dt=DT)
    # The state goes on: y and y' at the jump are where the other system starts.
    state = np.array([before[-1], (3 * before[-1] - 4 * before[-2] + before[-3]) / (2 * DT)])
    after = mf.simulate(
        mf.tf([5], [1, 3, 12]),
        input=u[2000:],
        duration=40.0,
        intervals=2000,
        initial_state=state,
    ).y[0]
    y = np.concatenate([before, after[1:]])
    y += 0.05 * y.std() * np.random.default_rng(3).standard_normal(y.size)
    est = mf.Estimator(TF2, band=9.0, cov_type="nonrobust")  # the noise is white
    live = mf.Stream(est, dt=DT, window=8.0)
    track = live.follow(mf.Record(y=y, u=u, dt=DT), every=10)
    # Some 160 moments on either side, about 30 independent windows' worth: 5 of their median standard errors
    # leave a false alarm of less than 1e-4.
    for part, truth in ((track.t <= 40.0, 8.0), (track.t >= 48.02, 12.0)):
        assert part.sum() > 150
        error, expected = np.abs(track["a2"] - truth)[part], np.median(track.bse[part, 1])
        assert expected < 0.06
        assert error.max() < 5 * expected
    slow = mf.Stream(est, dt=DT, window=8.0, forgetting=20.0)
    behind = slow.follow(mf.Record(y=y, u=u, dt=DT), every=10)
    later = behind.t >= 60.0
    assert np.all(behind["a2"][later] < track["a2"][later])  # it remembers the old value


def test_ten_million_samples_leave_nothing_behind():
    """The recursion after 10⁷ samples, a spike of 1e9 among them, against coefficients made anew."""
    rng = np.random.default_rng(0)
    live = mf.Stream(mf.Estimator(TF2, harmonics=28), dt=DT, window=10.0)
    y, u = rng.standard_normal((2, 100_000))
    y[50_000] = 1e9
    for _ in range(99):
        live.push(y, u)
    rec = simulated(ONE, 100_001)
    live.push(rec.y[:, 1:], rec.u[:, 1:])
    assert live.count == 10_000_000
    batch = quiet(live.record(), TF2, harmonics=28)
    np.testing.assert_allclose(live.params, batch.params, rtol=1e-9)
    np.testing.assert_allclose(live.fit().bse, batch.bse, rtol=1e-9)


def test_a_channel_that_stands_is_no_estimate():
    """Before the manoeuvre nothing moves: the status says so, and rounding is not taken for signal."""
    rec = simulated(ONE, nsr=0.0)
    hold = np.full((1, 1000), 0.1)
    live = stream()
    track = live.follow(mf.Record(y=np.hstack([3 * hold, rec.y]), u=np.hstack([hold, rec.u]), dt=DT))
    standing = track.t < 1000 * DT
    assert set(track.status[standing]) == {"rank"}
    assert np.isnan(track.params[standing]).all()
    last = mf.Record(y=np.hstack([rec.y, 3 * hold]), u=np.hstack([rec.u, hold]), dt=DT)
    live.clear()
    track = live.follow(last)
    assert track.status[-1] == "rank"
    with pytest.raises(mf.DataError, match=r"stands at 0.3 throughout"):
        live.fit()
    assert live.status == "rank"
    assert np.isnan(live.params).all()


def test_before_the_first_window():
    live = stream()
    live.push(np.zeros(400), np.zeros(400))
    assert not live.ready
    for ask in (live.fit, live.record, lambda: live.params, lambda: live.status):
        with pytest.raises(mf.DataError, match="400 of the 401 samples"):
            ask()
    assert "400 of 401 samples" in repr(live)
    assert len(live.follow(simulated(ONE, 11), every=100)) == 0
    assert live.ready


def test_names_units_and_times_reach_the_fit():
    rec = simulated(ONE)
    live = mf.Stream(
        mf.Estimator(TF2, band=9.0), dt=DT, window=8.0, outputs="q", inputs="de", units={"q": "deg/s"}
    )
    live.push(rec.y, rec.u)
    fit = live.fit()
    assert (fit.outputs, fit.inputs) == (("q",), ("de",))
    assert live.record().t[-1] == pytest.approx(live.t)
    assert live.record().units["q"] == "deg/s"
    assert fit.predict(live.record()).y.shape == (1, 401)


BAD = {
    "no estimator": (lambda: mf.Stream(TF2, dt=DT, window=8.0), "mf.Estimator"),
    "no band": (lambda: mf.Stream(mf.Estimator(TF2), dt=DT, window=8.0), "no band"),
    "no window": (lambda: mf.Stream(mf.Estimator(TF2, band=9.0), dt=DT), "window= or forgetting="),
    "short window": (lambda: mf.Stream(mf.Estimator(TF2, band=9.0), dt=DT, window=0.1), "5 intervals"),
    "step": (lambda: mf.Stream(mf.Estimator(TF2, band=9.0), dt=0.0, window=8.0), "dt=0.0"),
    "text": (lambda: mf.Stream(mf.Estimator(TF2, band=9.0), dt="a", window=8.0), "dt='a'"),
    "band above the rate": (
        lambda: mf.Stream(mf.Estimator(TF2, band=900.0), dt=DT, window=8.0),
        "sampled up to",
    ),
    "parabolic": (
        lambda: mf.Stream(mf.Estimator(TF2, band=9.0, rule="parabolic"), dt=DT, window=8.0),
        "gregory",
    ),
    "forgetting too long": (
        lambda: mf.Stream(mf.Estimator(TF2, band=9.0), dt=DT, window=1.0, forgetting=100.0),
        "at most 50",
    ),
    "forgetting without coefficients": (
        lambda: mf.Stream(mf.Estimator(TF2, band=9.0, noise="coloured"), dt=DT, forgetting=8.0),
        "use window=|give window=",
    ),
    "forgetting with ls": (
        lambda: mf.Stream(mf.Estimator(TF2, band=9.0, method="ls"), dt=DT, forgetting=8.0),
        'not with "ls"',
    ),
    "forgetting too short": (
        lambda: stream(forgetting=0.1),
        "leaves nothing",
    ),
    "names": (
        lambda: stream(outputs=["a", "b"]),
        "outputs names 2",
    ),
    "one name twice": (
        lambda: stream(outputs="q", inputs="q"),
        "'q' names more than one",
    ),
    "units of nothing": (
        lambda: stream(units={"zz": "m"}),
        "zz",
    ),
    "huge window": (
        lambda: mf.Stream(mf.Estimator(TF2, band=9.0), dt=DT, window=1e12),
        "at most 1048576",
    ),
    "long memory": (
        lambda: mf.Stream(mf.Estimator(TF2, band=9.0), dt=DT, window=1e4, forgetting=1e5),
        "would be remembered",
    ),
    "tiny step": (lambda: mf.Stream(mf.Estimator(TF2, band=9.0), dt=1e-300, window=1.0), "at most 1048576"),
    "few lines": (lambda: mf.Stream(mf.Estimator(TF2, band=0.9), dt=DT, window=8.0), "real equations"),
    "delay as long as the window": (
        lambda: mf.Stream(mf.Estimator(mf.TransferFunction(poles=2, delay=9.0), band=9.0), dt=DT, window=8.0),
        "a delay of 9 s",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_makes_no_stream_is_said(case):
    make, words = BAD[case]
    with pytest.raises((mf.SpecError, mf.DataError), match=words):
        make()


def test_bad_samples_are_refused_and_nothing_is_taken():
    rec = simulated(ONE)
    live = stream()
    live.push(rec.y, rec.u)
    before = live.params
    y = rec.y[0, :5].copy()
    y[3] = np.nan
    for bad_y, bad_u, words in (
        (y, rec.u[0, :5], "'y' is nan at sample 2004"),
        (rec.y[0, :5], np.inf * rec.u[0, :5], "'u' is"),
        (1.0, None, "1 samples of y, 0 of u"),
        (rec.y[0, :5], rec.u[0, :4], "5 samples of y, 4 of u"),
        (np.ones((2, 3)), rec.u[0, :3], "y has shape"),
        ("a", 1.0, "y holds str32 values"),
        (np.ma.masked_array(rec.y[0, :5], mask=[0, 1, 0, 0, 0]), rec.u[0, :5], "masked samples"),
        (1.0 + 1j, 1.0, "complex128"),
    ):
        with pytest.raises(mf.DataError, match=words):
            live.push(bad_y, bad_u)
    assert live.count == 2001
    np.testing.assert_array_equal(live.params, before)
    with pytest.raises(mf.DataError, match=r"step of 0.01"):
        live.follow(mf.Record(y=rec.y, u=rec.u, dt=0.01))
    with pytest.raises(mf.DataError, match="outputs"):
        live.follow(mf.Record(y=rec.y, u=rec.u, dt=DT, outputs="q"))
    for bad in (0, 1.5, True, 10**30):
        with pytest.raises(mf.SpecError, match="every="):
            live.follow(rec, every=bad)
    with pytest.raises(mf.SpecError, match="ndarray is not a Record"):
        live.follow(rec.y)
    with pytest.raises(mf.DataError, match="record's inputs are zoh, the stream's smooth"):
        live.follow(mf.Record(y=rec.y, u=rec.u, dt=DT, intersample="zoh"))


@pytest.mark.statistics
def test_noise_of_windows_that_are_forgotten():
    """σ, degrees of freedom, classical and spectral errors are those of the noise without the weights.

    200 records: the mean of σ² is within 5 % of the truth (its standard error is about 1 %); standardised
    errors of all kinds have a standard deviation between .85 and 1.2 (± .05; false alarm below .2 %).
    """
    sigma, scores = [], {"spectral": [], "HC3": [], "nonrobust": []}
    truth = np.array([3.0, 8.0, 5.0])
    clean = simulated(ONE, 2001, nsr=0.0)
    rng = np.random.default_rng(11)
    streams = {
        kind: mf.Stream(mf.Estimator(TF2, band=9.0, cov_type=kind), dt=DT, window=8.0, forgetting=8.0)
        for kind in scores
    }
    for _ in range(200):
        y = clean.y + 0.1 * rng.standard_normal(clean.y.shape)
        for kind, live in streams.items():
            live.clear()
            live.push(y, clean.u)
            scores[kind].append((live.params - truth) / live.bse)
            np.testing.assert_allclose(live.fit().bse, live.bse, rtol=1e-9)
        fit = live.fit()
        sigma.append(fit.sigma)
        assert fit.cost == pytest.approx(fit.df_resid * fit.sigma**2, rel=1e-9)
    assert np.mean(np.square(sigma)) == pytest.approx(0.01, rel=0.05)
    for kind in scores:
        spread = np.std(np.array(scores[kind]), axis=0)
        assert np.all((spread > 0.85) & (spread < 1.2)), (kind, spread)
    assert "Weights" in repr(fit.summary())
    assert fit.window_weights == pytest.approx(np.exp(-np.arange(5.0)))
    with pytest.raises(mf.SpecError, match="weighs its windows"):
        mf.bootstrap(fit)


def test_a_weighted_fit_is_kept_and_read_again(tmp_path):
    live = stream(forgetting=8.0)
    live.push(*(simulated(ONE).y, simulated(ONE).u))
    live.fit().save(tmp_path / "fit.json")
    assert mf.load(tmp_path / "fit.json").window_weights == live.fit().window_weights


def test_an_interrupt_leaves_nothing_half_done():
    """Whenever Ctrl-C comes, estimates and samples are of the same moment."""
    rec = simulated(ONE, 30_001)
    live = stream()
    live.push(rec.y[:, :1000], rec.u[:, :1000])
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        for delay in (0.01, 0.02, 0.03):
            signal.setitimer(signal.ITIMER_REAL, delay)
            try:
                while True:
                    live.follow(rec)
            except KeyboardInterrupt:
                pass
            batch = quiet(live.record(), TF2, band=9.0)
            np.testing.assert_allclose(live.params, batch.params, rtol=1e-9)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def test_one_thread_pushes_and_another_asks():
    rec = simulated(ONE, 4001)
    live = stream()
    live.push(rec.y[:, :500], rec.u[:, :500])
    raised, done = [], threading.Event()

    def ask():
        try:
            while not done.is_set():
                assert np.all(np.isfinite(live.params))
                live.fit()
        except Exception as error:
            raised.append(error)

    reader = threading.Thread(target=ask)
    reader.start()
    for k in range(500, 2000):
        live.push(rec.y[0, k], rec.u[0, k])
    done.set()
    reader.join()
    assert not raised
    assert live.count == 2000
    np.testing.assert_allclose(live.params, quiet(live.record(), TF2, band=9.0).params, rtol=1e-9)


def test_a_stream_is_not_changed_from_outside():
    live = stream()
    rec = simulated(ONE)
    live.push(rec.y, rec.u)
    kept = live.params
    kept *= 57.3
    np.testing.assert_allclose(57.3 * live.params, kept)
    with pytest.raises(AttributeError, match="dt"):
        live.dt = 1.0
    for make in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="cannot be copied"):
            make(live)


def test_times_are_those_of_the_record():
    rec = simulated(ONE).window(10.0, 30.0)
    live = stream(t0=3.0)
    track = live.follow(rec, every=401)
    assert track.t[0] == pytest.approx(18.0)
    assert live.t == pytest.approx(30.0)
    assert live.record().t[[0, -1]] == pytest.approx([22.0, 30.0])
    live.clear()
    live.push(0.0, 0.0)
    assert live.t == 3.0


def test_free_motion_has_no_inputs():
    rec = mf.simulate(
        mf.ss([[0, 1], [-9, -0.4]], np.zeros((2, 0)), [[1, 0]], np.zeros((1, 0))),
        duration=16.0,
        intervals=800,
        initial_state=[1.0, 0.0],
    )
    live = mf.Stream(mf.Estimator(mf.Equation("y'' + a1*y' + a2*y = 0"), band=9.0), dt=DT, window=8.0)
    live.push(rec.y)
    live.push(rec.y[:, :1], [])
    assert live.count == 802


def test_a_picture_of_the_estimates():
    pytest.importorskip("matplotlib")
    import matplotlib

    matplotlib.use("Agg")
    live = stream()
    track = live.follow(simulated(ONE), every=10)
    axes = track.plot()
    assert len(axes) == 3
    np.testing.assert_array_equal(axes[1].lines[0].get_ydata(), track["a2"])
    pytest.importorskip("pandas")
    assert list(track.to_pandas().columns[:2]) == ["a1", "a1_bse"]
