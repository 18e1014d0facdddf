"""Systems of python-control and SciPy, there and back, against what those packages compute with them."""

import sys
from itertools import pairwise

import modfun as mf
import numpy as np
import pytest
from scipy import signal

control = pytest.importorskip("control", reason="python-control is not installed")

OMEGA = np.geomspace(0.1, 20.0, 7)
TWO_BY_TWO = mf.tf([[[1], [2, 1]], [[3], [1, 0]]], [[[1, 1], [1, 2, 3]], [[1, 4], [1, 0.1]]])
SYSTEMS = {
    "one path": mf.tf([5], [1, 3, 8]),
    "feed-through": mf.tf([2, 1], [1, 4]),
    "gain": mf.tf([2], [1]),
    "integrator": mf.tf([1], [1, 2, 0]),
    "unstable": mf.tf([1], [1, -0.5]),
    "two inputs": mf.tf([[5], [1, 2]], [1, 3, 8]),
    "two outputs": mf.tf([[[1]], [[2, 1]]], [1, 3, 8]),
    "a missing path": mf.tf([[[1], None], [[2], [1, 1]]], [1, 3, 8]),
    "two by two": TWO_BY_TWO,
}
FORMS = {"tf": lambda system: system, "ss": mf.LTI.to_ss}


def response(system):
    return system.frequency_response(OMEGA).response


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("case", SYSTEMS)
def test_control_there_and_back(case, form):
    system = FORMS[form](SYSTEMS[case])
    other = system.to_control()
    assert other.dt == 0
    assert isinstance(other, control.TransferFunction if form == "tf" else control.StateSpace)
    found = control.frequency_response(other, OMEGA).frdata
    np.testing.assert_allclose(found, response(system), rtol=1e-10, atol=1e-14)
    again = mf.tf(other)
    np.testing.assert_allclose(response(again), response(system), rtol=1e-10, atol=1e-14)
    assert (again.matrices is None) == (form == "tf")


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("case", SYSTEMS)
def test_scipy_there_and_back(case, form):
    system = FORMS[form](SYSTEMS[case])
    again = mf.tf(system.to_scipy())
    np.testing.assert_allclose(response(again), response(system), rtol=1e-9, atol=1e-13)


def test_responses_in_time_agree():
    t = np.linspace(0.0, 5.0, 101)
    u = np.array([np.sin(t), np.cos(2 * t)])
    expected = TWO_BY_TWO.simulate(u=u, dt=0.05, intersample="foh")
    _, found, _ = signal.lsim(TWO_BY_TWO.to_scipy(), u.T, t)
    np.testing.assert_allclose(found.T, expected, rtol=1e-9, atol=1e-12)
    found = control.forced_response(TWO_BY_TWO.to_ss().to_control(), t, u).outputs
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


# Delays ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
def test_delays_as_pade_by_request_only(form):
    num, den = TWO_BY_TWO.polynomials()
    late = FORMS[form](mf.tf(num, den, delay=[0.1, 0.0]))
    with pytest.raises(mf.SpecError, match=r"delays \(0\.1, 0\.0\) s have no rational form; give pade="):
        late.to_control()
    errors = []
    for order in (1, 2, 4, 6):
        found = control.frequency_response(late.to_control(pade=order), OMEGA).frdata
        errors.append(np.abs(found - response(late)).max())
    assert errors[0] > 1e-2
    assert errors[-1] < 1e-8
    assert all(later < 0.1 * before for before, later in pairwise(errors))
    poles = {order: late.to_control(pade=order).poles().size for order in (1, 3)}
    assert poles[3] > poles[1]


@pytest.mark.parametrize("pade", [0, -1, 1.5, "3"])
def test_refused_orders_of_pade(pade):
    with pytest.raises(mf.SpecError, match="must be a whole number, at least 1"):
        mf.tf([1], [1, 1], delay=0.1).to_control(pade=pade)


def test_a_fit_with_a_delay_goes_to_control():
    rec = mf.simulate(mf.tf([5], [1, 3, 8], delay=0.2), input="sin(t**2/5)", duration=10.0, intervals=256)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0, delay=0.2))
    found = control.frequency_response(fit.model.to_control(pade=4), OMEGA[:5]).frdata
    np.testing.assert_allclose(found, fit.model.frequency_response(OMEGA[:5]).response, rtol=1e-3)


def test_a_delay_per_path_goes_to_control():
    late = mf.tf([[[1], [2, 1]], [[3], [1, 0]]], [1, 2, 3], delay=[[0.1, 0.0], [0.3, 0.2]])
    with pytest.raises(
        mf.SpecError, match=r"delays \(\(0\.1, 0\.0\), \(0\.3, 0\.2\)\) s have no rational form"
    ):
        late.to_control()
    found = control.frequency_response(late.to_control(pade=6), OMEGA[:5]).frdata
    np.testing.assert_allclose(found, response(late)[:, :, :5], rtol=1e-5)
    with pytest.raises(mf.SpecError, match="SciPy's systems have no delay"):
        late.to_scipy()


@pytest.mark.parametrize("form", FORMS)
def test_names_of_channels_go_to_control_and_back(form):
    plant = mf.tf([[[1], [2, 1]], [[3], [1, 0]]], [1, 2, 3])
    rec = mf.simulate(plant, input=["sin(t**2/5)", "cos(t**2/7)"], duration=10.0, intervals=256,
                      nsr=0.01, outputs=["alpha", "q"], inputs=["de", "da"])  # fmt: skip
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1, denominator="common"), band=12.0)
    other = FORMS[form](fit.model).to_control()
    assert (other.input_labels, other.output_labels) == (["de", "da"], ["alpha", "q"])
    again = mf.tf(other)
    assert (again.inputs, again.outputs) == (("de", "da"), ("alpha", "q"))
    frd = fit.model.frequency_response(OMEGA).to_control()
    assert (frd.input_labels, frd.output_labels) == (["de", "da"], ["alpha", "q"])


def test_channels_that_nobody_named_keep_the_numbers_of_control():
    rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    assert (fit.model.inputs, fit.model.outputs) == (None, None)
    assert fit.model.to_control().input_labels == ["u[0]"]
    assert mf.tf(fit.model.to_control()).inputs is None


def test_scipy_refuses_delays():
    with pytest.raises(mf.SpecError, match=r"no delay and this one has \(0\.1,\) s; use to_control"):
        mf.tf([1], [1, 1], delay=0.1).to_scipy()


def test_a_delay_is_added_to_what_has_none():
    late = mf.tf(control.tf([5], [1, 3, 8]), delay=0.1)
    assert late.delay == mf.tf(late).delay == 0.1
    assert mf.ss(SYSTEMS["one path"], delay=0.1).delay == 0.1
    with pytest.raises(mf.SpecError, match=r"delays \(0\.1,\) s of its own"):
        mf.tf(late, delay=0.2)


# Objects of others -------------------------------------------------------------------------------


def test_zeros_poles_gain_and_several_outputs():
    for made in (signal.ZerosPolesGain([-1], [-2, -3], 4.0), control.zpk([-1], [-2, -3], 4.0)):
        np.testing.assert_allclose(mf.tf(made).num, [4, 4])
        np.testing.assert_allclose(mf.tf(made).den, [1, 5, 6])
    two = mf.tf(signal.TransferFunction([[0, 1], [1, 2]], [1, 2]))
    np.testing.assert_allclose(response(two)[:, 0], [1 / (1j * OMEGA + 2), np.ones(7)])
    named = mf.tf(control.tf([1], [1, 2], inputs="de", outputs="q", dt=None))
    assert named.dcgain() == 0.5


def test_ss_takes_systems():
    for given in (signal.lti([5], [1, 3, 8]), SYSTEMS["one path"], control.tf([5], [1, 3, 8])):
        system = mf.ss(given)
        assert system.A.shape == (2, 2)
        np.testing.assert_allclose(response(system), response(SYSTEMS["one path"]), rtol=1e-12)
    state = control.ss([[-1.0]], [[1.0]], [[2.0]], [[0.5]])
    for found, expected in zip(mf.ss(state).matrices, (state.A, state.B, state.C, state.D), strict=True):
        assert np.array_equal(found, expected)
    with pytest.raises(mf.SpecError, match="give A, B and C"):
        mf.ss([[-1.0]])
    with pytest.raises(mf.SpecError, match="got only str"):
        mf.ss("1/s")


@pytest.mark.parametrize(
    "given", [control.tf([5], [1, 3, 8]), signal.lti([5], [1, 3, 8])], ids=["control", "scipy"]
)
def test_systems_of_others_serve_wherever_an_lti_does(given):
    own = mf.tf([5], [1, 3, 8])
    words = {"input": "sin(t**2/5)", "duration": 10.0, "intervals": 256, "nsr": 0.1, "seed": 3}
    rec = mf.simulate(own, **words)
    assert np.array_equal(mf.simulate(given, **words).y, rec.y)
    assert np.array_equal(mf.crlb(given, rec, nsr=0.1).sd, mf.crlb(own, rec, nsr=0.1).sd)
    study = {**words, "replicates": 8, "estimators": ["ml"]}
    assert np.array_equal(
        mf.MonteCarlo(system=given, **study).run().bias, mf.MonteCarlo(system=own, **study).run().bias
    )
    structure = mf.TransferFunction.from_system(given)
    assert structure == mf.TransferFunction(poles=2, zeros=0)
    np.testing.assert_allclose(structure.theta(given), [3, 8, 5])
    assert mf.timelag.from_fit(given).order == 2
    fit = mf.fit(rec, structure)
    magnitude, _ = mf.plot.bode(given, fit, own, labels=["given", "fit", "own"])
    curves = {line.get_label(): line.get_ydata() for line in magnitude.lines}
    np.testing.assert_allclose(curves["given"], curves["own"], rtol=1e-9)
    assert "fit u → y" in curves


def test_what_cannot_serve_is_refused_by_the_name_of_the_call():
    with pytest.raises(mf.SpecError, match="simulate: the system is discrete in time"):
        mf.simulate(control.tf([1], [1, 0.5], True), input="t", duration=1.0, intervals=4)
    with pytest.raises(mf.SpecError, match=r"plot\.bode: this is a frequency response"):
        mf.plot.bode(control.frd([1.0, 2.0], [1.0, 2.0]))


def test_frequency_responses_go_to_control_and_back():
    found = TWO_BY_TWO.frequency_response(OMEGA)
    other = found.to_control()
    assert isinstance(other, control.FrequencyResponseData)
    assert np.array_equal(other.omega, OMEGA)
    assert np.array_equal(other.frdata, found.response)
    assert np.array_equal(mf.FrequencyResponse(other.omega, other.frdata).response, found.response)
    with pytest.raises(mf.SpecError, match="a frequency response, which has no polynomials"):
        mf.tf(other)


@pytest.mark.parametrize(
    "made",
    [
        lambda: signal.TransferFunction([1], [1, 0.5], dt=0.1),
        lambda: control.tf([1], [1, 0.5], True),
        lambda: control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1),
    ],
)
def test_discrete_systems_are_refused(made):
    with pytest.raises(mf.SpecError, match="discrete in time"):
        mf.tf(made())


def test_what_is_no_linear_system_is_refused():
    for given in (control.nlsys(None, lambda t, x, u, p: u, inputs=1, outputs=1), 3, ([1], [1, 2])):
        with pytest.raises(mf.SpecError, match=f"got only {type(given).__name__}"):
            mf.tf(given)


def test_without_control(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ImportError, match=r"LTI\.to_control needs control: pip install 'modfun\[control\]'"):
        TWO_BY_TWO.to_control()


def test_a_free_motion_is_refused_in_words():
    """It ended with a traceback from inside python-control."""
    t = np.arange(0, 3, 0.005)
    y = np.exp(-t) * np.cos(20 * t) + 0.01 * np.random.default_rng(0).standard_normal(t.size)
    fit = mf.fit(mf.Record(y=y, dt=0.005), mf.TransferFunction(poles=2, zeros=0))
    with pytest.raises(mf.SpecError, match="a free motion has no input"):
        fit.model.to_control()


def test_a_fit_or_a_reduction_stands_for_its_model():
    rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=128, seed=0)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    assert np.array_equal(mf.tf(fit).poles(), fit.model.poles())
    assert np.array_equal(mf.ss(fit).A, mf.ss(fit.model).A)
    assert mf.ss(mf.reduce(fit.model, 1)).A.shape == (1, 1)
