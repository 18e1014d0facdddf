"""What fits say where a channel is in another unit or sign, a number is wrong, or an input was left out."""

from dataclasses import replace

import modfun as mf
import numpy as np
import pytest
from flights import warned
from modfun.results.held_numbers import OF_ANGLES, Number, _of_scales
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete

PITCH = (np.array([[-1.2, 1], [-9, -1.8]]), np.array([[-0.1], [-12]]))
LATERAL = (
    np.array([[-0.25, 0.03, -0.99, 0.1635], [-12, -3, 0.9, 0], [5, -0.2, -0.6, 0], [0, 1, 0.03, 0]]),
    np.array([[0, 0.05], [-8, 2], [-0.4, -3], [0, 0]]),
)
SHORT = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
WRITTEN = mf.Equation(
    ["alpha' = Za*alpha + q + Zd*de + c1", "q' = Ma*alpha + Mq*q + Md*de + c2"],
    outputs=["alpha", "q"],
    inputs=["de"],
)


def lateral(*inputs, gravity="9.81/60"):
    """The lateral motion with some of its inputs."""
    rows = {"da": [0, "Lda", "Nda", 0], "dr": ["Ydr", "Ldr", "Ndr", 0]}
    return mf.StateSpace(
        [["Yb", 0.03, -0.99, gravity], ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, 0.03, 0]],
        [list(row) for row in zip(*[rows[name] for name in inputs], strict=True)],
        states=["beta", "p", "r", "phi"],
        inputs=list(inputs),
    )


def flown(system, outputs, inputs, seed, **scales):
    """Doublets held by a computer, 2 % noise, channels times `scales`."""
    a, b = system
    t, n = np.arange(600) * 0.02, len(a)
    u = np.array([
        sum(
            size * ((t > at) & (t < at + width))
            for at, width, size in ((1 + 3 * k, 0.6, 0.1), (1.6 + 3 * k, 0.6, -0.1), (7 + k, 0.5, 0.08))
        )
        for k in range(len(inputs))
    ])  # fmt: skip
    step, drive, *_ = cont2discrete((a, b, np.eye(n), np.zeros(b.shape)), 0.02)
    x = np.zeros((n, t.size))
    x[:, 0] = 0.02
    for k in range(t.size - 1):
        x[:, k + 1] = step @ x[:, k] + drive @ u[:, k]
    y = x + 0.02 * x.std(axis=1, keepdims=True) * np.random.default_rng(seed).normal(size=x.shape)
    ys = {name: scales.get(name, 1) * row for name, row in zip(outputs, y, strict=True)}
    us = {name: scales.get(name, 1) * row for name, row in zip(inputs, u, strict=True)}
    return mf.Record(ys, us, dt=0.02, intersample="zoh")


@pytest.mark.parametrize("channel", ["beta", "p", "r", "phi"])
@pytest.mark.parametrize(
    ("scale", "said", "cure"),
    [
        (180 / np.pi, "{} seems to be in degrees and not in radians", "{0}=rec['{0}']/57.3)"),
        (-1, "{} seems to be of the opposite sign", "{0}=-rec['{0}'])"),
    ],
)
def test_the_channel_in_another_unit_or_sign_is_named(channel, scale, said, cure):
    """Kinematics and gravity tell which of four outputs it is; every fit says so."""
    for seed in range(2):
        rec = flown(LATERAL, ("beta", "p", "r", "phi"), ("da", "dr"), seed, **{channel: scale})
        text = warned(rec, lateral("da", "dr"))[1]
        assert said.format(channel) in text
        assert "rec.assign(" + cure.format(channel) in text


def test_two_channels_in_degrees_are_named_together():
    scales = {"p": 180 / np.pi, "phi": 180 / np.pi}
    rec = flown(LATERAL, ("beta", "p", "r", "phi"), ("da", "dr"), 1, **scales)
    text = warned(rec, lateral("da", "dr"))[1]
    assert "rec.assign(p=rec['p']/57.3, phi=rec['phi']/57.3); the inverse change of beta and r" in text


@pytest.mark.parametrize("model", [SHORT, WRITTEN])
def test_either_of_two_channels_is_named_with_the_other(model):
    for seed in range(3):
        text = warned(flown(PITCH, ("alpha", "q"), ("de",), seed, q=180 / np.pi), model)[1]
        assert "the record has 0.017" in text
        place = "in the equation of alpha'" if model is SHORT else f"on the right of {model.texts[0]!r}"
        assert f"times q {place}, where the model has 1." in text
        assert "rec.assign(q=rec['q']/57.3); the inverse change of alpha would do the same." in text


def test_a_vane_in_degrees_is_named_though_a_term_is_missing():
    """No lift of the elevator in the model, which was called a lag longer than the record."""
    rec = flown(PITCH, ("alpha", "q"), ("de",), 1, alpha=180 / np.pi)
    text = warned(rec, SHORT._like(B=[[0], ["Md"]]))[1]
    assert "rec.assign(alpha=rec['alpha']/57.3); the inverse change of q would do the same." in text


def test_what_the_parameters_take_up_is_not_warned_of():
    """All angles in degrees, and the elevator the other way round: other numbers, and no wrong ones."""
    for scales in ({"alpha": 57.3, "q": 57.3, "de": 57.3}, {"de": -1}):
        fit, text = warned(flown(PITCH, ("alpha", "q"), ("de",), 2, **scales), SHORT)
        assert text == ""
        assert abs(fit["Za"] + 1.2) < 4 * fit.bse["Za"]


def test_an_accelerometer_in_g_is_named_where_a_state_is_not_measured():
    (a, b), rec = PITCH, flown(PITCH, ("alpha", "q"), ("de",), 3)
    az = 60 * (a[0, 0] * rec["alpha"] + b[0, 0] * rec["de"]) / 9.80665
    both = mf.Record({"q": rec["q"], "az": az}, {"de": rec["de"]}, dt=0.02, intersample="zoh")
    model = SHORT._like(C=[[0, 1], ["60*Za", 0]], D=[[0], ["60*Zd"]], outputs=["q", "az"])
    text = warned(both, model)[1]
    assert "az seems to be in g and not in m/s²" in text
    assert "First try rec.assign(az=rec['az']*9.807): BIC falls from" in text
    assert warned(both.assign(az=az * 9.80665), model)[1] == ""


def test_outputs_with_names_of_their_own_are_named():
    model = SHORT._like(outputs=["vane", "gyro"])
    text = warned(flown(PITCH, ("vane", "gyro"), ("de",), 1, gyro=180 / np.pi), model)[1]
    assert "rec.assign(gyro=rec['gyro']/57.3); the inverse change of vane would do the same." in text


def test_a_number_that_no_unit_explains_is_named():
    """Gravity over the speed is three times too large in the model."""
    rec = flown(LATERAL, ("beta", "p", "r", "phi"), ("da", "dr"), 1)
    fit, text = warned(rec, lateral("da", "dr", gravity="9.81/20"))
    assert "A number in the equations contradicts the record: the record has 0.16" in text
    assert "times phi in the equation of beta', where the model has 0.4905" in text
    assert any(text.removeprefix("fit: ") == one for one in fit.check())


def test_an_input_of_the_record_that_the_model_lacks_is_named():
    """With the aileron alone, and all else right."""
    for seed in range(3):
        rec = flown(LATERAL, ("beta", "p", "r", "phi"), ("da", "dr"), seed)
        fit, text = warned(rec, lateral("da"))
        assert "Input 'dr' is in the record and not in the model" in text
        assert fit.inputs == ("da",)
    assert warned(rec.select(inputs=["da", "dr"]), lateral("da", "dr"))[1] == ""


def test_an_input_that_an_equation_lacks_is_named():
    a, b = PITCH
    rec = flown((a, np.hstack([b, [[0.0], [4.0]]])), ("alpha", "q"), ("de", "dc"), 1)
    text = warned(rec, WRITTEN)[1]
    assert "Input 'dc' is in the record and not in the model" in text


def test_a_rate_of_turn_is_in_no_knots():
    """A step read twice too long was named so, and the advice left derivatives at a quarter in silence."""
    numbers = [Number("the number 1 beside q in the equation of alpha", 1.0, {"q": 1}, 1.94, 0.01)]
    knots = _of_scales(numbers, (), {})
    assert knots is not None
    assert "in knots and not in m/s" in knots.text
    assert _of_scales(numbers, (), {"q": OF_ANGLES}) is None


def test_signs_that_cancel_out_explain_no_number():
    """Of v' = v - v**3/3 - w with 0.3 for a third: factors of -1.05 of both had explained it."""
    numbers = [
        Number("v**3 in the equation of v", -1 / 3, {"v": -2}, -0.3043, 0.0059),
        Number("w in the equation of v", -1.0, {"v": 1, "w": -1}, -0.996, 0.01),
    ]
    assert _of_scales(numbers, (), {}) is None
    turned = _of_scales([replace(numbers[0], found=-1 / 3), replace(numbers[1], found=0.996)], (), {})
    assert turned is not None
    assert "v or w seems to be of the opposite sign, the record does not tell which" in turned.text
    assert "the record has 0.996 ± 0.01 times w" in turned.text


def _brusselator(count, seed):
    """A record over 25 s with 0.1 % noise, and its equations."""
    t = np.linspace(0, 25, count)

    def rates(_, x):
        return [1 - 4 * x[0] + x[0] ** 2 * x[1], 3 * x[0] - x[0] ** 2 * x[1]]

    y = solve_ivp(rates, (0, 25), [1, 1], t_eval=t, rtol=1e-10, atol=1e-12).y
    noise = 0.001 * y.std(axis=1, keepdims=True) * np.random.default_rng(seed).standard_normal(y.shape)
    rec = mf.Record(dict(zip("xz", y + noise, strict=True)), t=t)
    return rec, mf.Equation(["x' = A - (B+1)*x + x**2*z", "z' = B*x - x**2*z"], outputs=["x", "z"])


def test_a_brusselator_of_the_right_numbers_has_no_wrong_sign():
    """Ten samples a second on its spikes: sums over these err by 0.04 %, which no sign explains.

    Of seeds 0 to 4, several had "x and z seem to be of the opposite sign".
    """
    for seed in range(5):
        assert "sign" not in warned(*_brusselator(251, seed))[1]


def test_numbers_beside_sums_over_few_samples_are_not_called_wrong():
    """Five a second: "the record has 0.955 where the model has 1". What sums leave is taken out now.

    The largest of six normal errors is below 3.5 but for once in 360 tests.
    """
    for seed in range(3):
        fit, text = warned(*_brusselator(126, seed))
        assert text == ""
        assert np.all(np.abs(fit.params - [1, 3]) < 3.5 * fit.bse)
