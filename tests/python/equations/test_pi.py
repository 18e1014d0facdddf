"""The name pi in models: the number, refused wherever it may be meant as a parameter or a channel."""

import modfun as mf
import numpy as np
import pytest

pytest.importorskip("sympy")

EQUATION, MATRICES = ("y' + pi*y = b*u",), ([["-pi"]], [["b"]], [[1]])
MODELS = [(mf.Equation, EQUATION, {}), (mf.StateSpace, MATRICES, {"outputs": ["y"]})]


@pytest.mark.parametrize(("kind", "words", "more"), MODELS)
def test_pi_is_the_number(kind, words, more):
    model = kind(*words, **more)
    truth = mf.tf([2.0], [1.0, np.pi])
    rec = mf.simulate(truth, input="sin(t**2/4)", duration=10, intervals=512)
    assert model.param_names() == ("b",)
    assert mf.fit(rec, model).params["b"] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("value", [3.0, mf.Free(3.0)])
@pytest.mark.parametrize(("kind", "words", "more"), MODELS)
def test_pi_is_refused_as_a_parameter(kind, words, more, value):
    with pytest.raises(mf.SpecError, match=r"'pi', which is the number 3\.14159…; give the parameter"):
        kind(*words, **more, params={"pi": value})


@pytest.mark.parametrize(("kind", "words", "more"), MODELS)
def test_pi_is_refused_beside_a_channel_of_that_name(kind, words, more):
    t = np.arange(129) * 0.1
    rec = mf.Record(y=np.cos(t), u=[np.sin(t), np.cos(2 * t)], inputs=["u", "pi"], dt=0.1)
    with pytest.raises(mf.SpecError, match=r"'pi' is a channel of the record and the number.*rec\.select"):
        mf.fit(rec, kind(*words, **more))
    assert len(mf.fit(rec, mf.Equation("y' + a*y = b*u")).params) == 2  # without pi the channel is left out
