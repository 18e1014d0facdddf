"""What fit and check say of errors, repeated samples and biased methods, where a user looks."""

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.results import check, misfit
from modfun.results.diagnosis import diagnose
from scipy.signal import butter, filtfilt, lfilter


def test_one_kind_of_errors_serves_white_and_coloured_noise():
    """Of a light mode: classical ones within 60 % in white noise, larger in AR(.95) noise."""
    light = mf.simulate(mf.tf([1], [1, 0.2, 1]), input="sin(t**2/5)", duration=10.0, intervals=256)
    rng = np.random.default_rng(3)
    white = rng.standard_normal(557)
    coloured = lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], white)
    for noise, low, high in ((white, 0.6, 1.6), (coloured, 1.6, 6.0)):
        rec = light.assign(y=light["y"] + 0.05 * np.sqrt(np.mean(light.y**2)) * noise[300:])
        fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), harmonics=20)
        assert bool(fit.check()) == (noise is coloured)
        ratio = fit.bse / np.sqrt(np.diag(fit.cov_nonrobust))
        assert np.all((ratio > low) & (ratio < high)), ratio


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
    for level in (0.95, 0.5, 1 - 1e-12):
        assert len(fit.table(level=level).columns) == 6


STEPS = "1*(t>1) - 2*(t>5) + 1.5*(t>9) - 1*(t>14)"


@pytest.mark.parametrize(
    ("truth", "text", "poles"),
    [
        (mf.tf([5], [1, 3, 8]), "sin(t**2/5)", 1),
        (mf.tf([5], [1, 3, 8], delay=0.25), STEPS, 2),
        (mf.tf([2, 5], [1, 3, 8, 4]), "sin(t**2/5)", 2),
        (mf.tf([1, 3, 13], [1, 3, 8]), "sin(t**2/5)", 3),
    ],
)
def test_a_fit_warns_of_the_first_sure_doubt_of_all(truth, text, poles):
    rec = mf.simulate(truth, input=text, duration=20.0, intervals=512, nsr=0.05, seed=3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        fit = mf.fit(rec, mf.TransferFunction(poles=poles, zeros=poles - 1))
    every = misfit.of_residuals(fit, diagnose(fit))
    assert misfit.misfit(fit) == next((doubt for doubt in every if doubt and doubt.sure), None)


def test_a_fit_tries_no_cure_that_only_check_would_say(monkeypatch):
    """Of filtered samples the high band is empty, no sure doubt: noise in each equation is not tried."""
    system = mf.ss([[0, 1], [-8, -3]], [[0], [5]], np.eye(2), np.zeros((2, 1)))
    rec = mf.simulate(system, input="sin(t**2/5)", duration=20.0, intervals=512, nsr=0.1, seed=3)
    rec = rec.assign(**{name: filtfilt(*butter(3, 0.3), rec[name]) for name in rec.outputs})
    model = mf.StateSpace([[0, 1], ["a", "b"]], [0, "c"], states=list(rec.outputs), inputs=["u"])
    asked = []
    monkeypatch.setattr(misfit, "gain_of_process", lambda fit: asked.append(fit))
    with warnings.catch_warnings():
        warnings.simplefilter("error", mf.ModfunWarning)
        fit = mf.fit(rec, model, harmonics=20)
    assert not asked
    assert "the high band is empty" in str(fit.check())
    assert asked == [fit]


@pytest.mark.parametrize("model", ["transfer function", "state space", "equation"])
def test_an_offset_that_bends_the_estimate_is_told(model):
    """Trim of five times the motion, records filtered as in flight; line 0's own residual stays small then.

    False alarm: a constant would have to halve residuals of white noise, which no record does.
    """
    structure = {
        "transfer function": mf.TransferFunction(poles=2, zeros=1),
        "state space": mf.StateSpace(
            [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"]
        ),
        "equation": mf.Equation(
            ["alpha' = Za*alpha + q + Zd*de", "q' = Ma*alpha + Mq*q + Md*de"],
            outputs=["alpha", "q"],
            inputs=["de"],
        ),
    }[model]
    truth = mf.ss([[-0.9, 1], [-5.2, -1.4]], [[-0.12], [-7.5]], np.eye(2), np.zeros((2, 1)))
    steps = mf.signals.multistep("de", [3, 2, 1, 1], unit=0.4, dt=0.02, amplitude=2.0, duration=14, before=1)
    rec = mf.simulate(truth, input=steps, nsr=0.05, outputs=["alpha", "q"], seed=3)
    rec = rec.assign(**{name: filtfilt(*butter(4, 0.3), rec[name]) for name in rec.outputs})
    trimmed = rec.assign(alpha=rec["alpha"] + 5.0, q=rec["q"] + 0.4, de=rec["de"] - 1.5)

    def said(data):
        data = data.select(outputs=["q"]) if model == "transfer function" else data
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            mf.fit(data, structure, trend=None)
        return " ".join(str(one.message) for one in caught)

    assert 'channels have an offset. Fit with trend="constant"' in said(trimmed)
    assert "have an offset" not in said(rec)


def test_angles_in_two_units_are_told_where_an_equation_suffers():
    """alpha in degrees beside q in rad/s: the fit did not settle, and blamed its iterations."""
    equation = mf.Equation(
        ["alpha' = q - Za*alpha + Zd*d + c1", "q' = Ma*alpha + Mq*q + Md*d + c2"],
        outputs=["alpha", "q"],
        inputs=["d"],
    )
    plant = mf.ss([[-1.2, 1.0], [-9.0, -2.0]], [[-0.1], [-12.0]], np.eye(2), np.zeros((2, 1)))
    words = {"input": "1*(t>1) - 2*(t>4) + 1*(t>7)", "intersample": "zoh"}
    made = mf.simulate(plant, **words, duration=12.0, intervals=600, nsr=0.03, seed=1)
    names = {"outputs": ["alpha", "q"], "inputs": "d", "intersample": "zoh"}
    y = made.y * [[180 / np.pi], [1.0]]
    rec = mf.Record(y=y, u=made.u, dt=made.dt, units={"alpha": "deg", "q": "rad/s"}, **names)
    with pytest.warns(mf.ModfunWarning, match="fit: Output 'alpha' is in deg and 'q' in rad/s: equations"):
        fit = mf.fit(rec, equation)
    assert "Output 'alpha' is in deg" in fit.check()
    right = mf.fit(rec.convert(alpha="rad"), equation)
    assert np.max(np.abs((right["Ma"] + 9.0) / right.bse[3])) < 4
    assert "in deg" not in right.check()
    each = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1, denominator="common"))
    assert "in deg" not in each.check()  # a transfer function to each needs no common unit


def test_a_channel_that_stands_in_each_record_is_no_large_offset():
    """The speed of two records, 1.2, has a spread of 2e-16 by rounding."""
    records = []
    for seed, speed in enumerate((1.0, 1.2)):
        rec = mf.simulate(
            mf.tf([5 * speed], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=400, nsr=0.05,
            seed=seed,
        )  # fmt: skip
        records.append(rec.assign(V=np.full(401, speed)).select(inputs=["u", "V"]))
    fit = mf.fit(records, mf.Equation("y'' + a1*y' + a2*y = b0*V*u", inputs=["u", "V"]))
    assert np.all(np.abs(fit.params - [3, 8, 5]) < 4 * fit.bse)  # 1 in 5,000 pairs of records fails
    assert "Write the equation for deviations" not in str(fit.check())


def test_a_look_that_fails_loses_no_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """SymPy compared a complex number in one of a hundred terms that were tried, and the fit was lost."""

    def broken(fit: mf.Fit) -> None:
        raise TypeError("Invalid comparison of non-real 1.0 + 2.0*I")

    monkeypatch.setattr(check, "LOOKS", (broken, *check.LOOKS))
    monkeypatch.setattr(check, "FAILURES", (Exception,))
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=20.0, intervals=512, nsr=0.1, seed=1
    )
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    np.testing.assert_allclose(fit.params, [3, 8, 5], rtol=0.1)
    assert list(fit.check()) == [
        "A part of this check, broken, failed (TypeError: Invalid comparison of non-real 1.0 + 2.0*I): "
        "please report it."
    ]
