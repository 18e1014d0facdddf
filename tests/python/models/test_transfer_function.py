"""The structure TransferFunction: counts, names, and numbers in and out."""

import pickle

import modfun as mf
import numpy as np
import pytest
from modfun import TransferFunction


def test_defaults_and_names():
    assert TransferFunction(poles=3).zeros == 2
    assert TransferFunction(poles=2, zeros=0).param_names() == ("a1", "a2", "b0")
    two = TransferFunction(poles=2, zeros=[1, None], delay=[0.1, 0])
    assert two.param_names(["de", "da"]) == ("a1", "a2", "b0[de]", "b1[de]")
    layout = two.layout(["y"], ["de", "da"])
    assert layout.numerators == ((1, None),)
    assert layout.delays(np.zeros(0)) == (0.1, 0.0)
    assert two.n_inputs == 2
    shared = TransferFunction(poles=1, zeros=0, delay=0.2)
    assert shared.n_inputs is None
    layout = shared.layout(["y"], ["u1", "u2"])
    assert layout.numerators == ((0, 0),)
    assert layout.delays(np.zeros(0)) == (0.2, 0.2)
    assert shared.param_names(["u1", "u2"]) == ("a1", "b0[u1]", "b0[u2]")


def test_frozen_equal_hashable_pickled():
    a = TransferFunction(poles=2, zeros=[1, None])
    assert a == TransferFunction(poles=2, zeros=(1, None))
    assert hash(a) == hash(TransferFunction(poles=2, zeros=(1, None)))
    assert pickle.loads(pickle.dumps(a)) == a
    assert repr(a) == "TransferFunction(poles=2, zeros=[1, None])"
    with pytest.raises(AttributeError):
        a.poles = 3
    with pytest.raises(mf.SpecError, match=r"write TransferFunction\(poles=\.\.\., zeros=\.\.\.\)"):
        TransferFunction(2, 0)


def test_more_zeros_than_poles_are_refused_with_the_equation_to_write():
    line = r"y' \+ a1\*y = b0\*u'' \+ b1\*u' \+ b2\*u"
    with pytest.raises(mf.SpecError, match=rf'2 zeros with 1 poles.*mf\.Equation\("{line}"\)'):
        TransferFunction(poles=1, zeros=2)
    separate = TransferFunction(poles=[1, 3], zeros=[[2], [1]], denominator="separate")
    with pytest.raises(mf.SpecError, match=rf'more zeros than the 1 poles.*mf\.Equation\("{line}"\)'):
        separate.layout(["q", "r"], ["de"])
    equation = mf.Equation(line.replace("\\", ""))
    assert equation.param_names() == ("a1", "b0", "b1", "b2")


def test_numbers_in_and_out():
    structure = TransferFunction(poles=2, zeros=0)
    system = structure.model([3, 8, 5])
    np.testing.assert_array_equal(system.den, [1, 3, 8])
    np.testing.assert_array_equal(system.num, [5])
    np.testing.assert_array_equal(structure.theta(system), [3, 8, 5])
    assert structure.model({"b0": 5, "a1": 3, "a2": 8}) == system
    assert TransferFunction.from_system(system) == structure
    two = TransferFunction(poles=2, zeros=[1, 0, None], delay=[0.1, 0.0, 0.0])
    system = two.model([3, 8, 1, 2, 5])
    assert system.shape == (1, 3)
    assert system.delay == (0.1, 0.0, 0.0)
    np.testing.assert_array_equal(two.theta(system), [3, 8, 1, 2, 5])
    assert TransferFunction.from_system(system) == two
    wider = TransferFunction(poles=2, zeros=1)
    np.testing.assert_array_equal(wider.theta(mf.tf([5], [1, 3, 8])), [3, 8, 0, 5])
    assert TransferFunction.from_system(mf.tf([5], [1, 3, 8]).to_ss()) == structure


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: TransferFunction(poles=0), "at least 1"),
        (lambda: TransferFunction(poles=2.0), "whole number"),
        (lambda: TransferFunction(poles=True), "whole number"),
        (lambda: TransferFunction(poles=2, zeros=3), "3 zeros with 2 poles"),
        (lambda: TransferFunction(poles=2, zeros=-1), "at least 0"),
        (lambda: TransferFunction(poles=2, zeros="any"), "whole numbers"),
        (lambda: TransferFunction(poles=2, zeros=[None, None]), "no input with a path"),
        (lambda: TransferFunction(poles=2, zeros=[[1], [0]]), "whether they share their poles"),
        (lambda: TransferFunction(poles=2, delay=-0.1), "at least 0"),
        (lambda: TransferFunction(poles=2, delay="late"), "not a number"),
        (lambda: TransferFunction(poles=2, delay=np.nan), "finite"),
        (lambda: TransferFunction(poles=2, zeros=[1, 1], delay=[0.1]), "different numbers of inputs"),
        (lambda: TransferFunction(poles=2, zeros=[1, 1]).param_names(["a", "b", "c"]), "made for 2 input"),
        (lambda: TransferFunction(poles=2, zeros=0).model([1, 2]), "2 numbers for 3"),
        (lambda: TransferFunction(poles=1, zeros=0).model({"a1": 1, "b1": 2}), "'b0'; the parameters are a1"),
        (lambda: TransferFunction(poles=2, zeros=0).theta(mf.tf([1, 1], [1, 3, 8])), "does not hold"),
        (lambda: TransferFunction(poles=1).theta(mf.tf([1], [1, 3, 8])), "does not hold"),
        (lambda: TransferFunction(poles=[2, 3]), "separate"),
        (lambda: TransferFunction(poles=2, denominator="shared"), "common"),
        (lambda: TransferFunction(poles=2, delay=mf.Free(0.1)), "needs a max"),
        (lambda: TransferFunction(poles=2).param_names(["u"], ["a", "q"]), "share their poles"),
        (lambda: TransferFunction(poles=2, params={"a3": 1.0}).param_names(), "'a2'"),
        (lambda: TransferFunction(poles=2, params={"a1": "3"}), "must be a number"),
        (lambda: TransferFunction(poles=1, zeros=0, params={"a1": 1, "b0": 2}).param_names(), "every"),
        (lambda: mf.Free(0.6, min=0, max=0.5), "between"),
        (lambda: mf.Free(min=1, max=1), "fixed parameter is a number"),
        (lambda: TransferFunction.from_system(mf.tf([[[1], [2]]], [[[1, 1], [1, 2]]])), "common"),
        (lambda: TransferFunction.from_system(mf.tf([1], [1])), "static gain"),
    ],
)
def test_mistakes(make, said):
    with pytest.raises(mf.SpecError, match=said):
        make()


def test_pairs_that_were_meant_as_bounds() -> None:
    with pytest.raises(mf.errors.SpecError, match=r"or mf.Free\(...\), mf.Free\(min=0, max=5\) for bounds"):
        mf.TransferFunction(poles=2, zeros=0, params={"a2": (0, 5)})
    with pytest.raises(mf.errors.SpecError, match=r"mf.Free\(min=0, max=5\) for bounds"):
        mf.Equation("y' + a*y = u", params={"a": (0, 5)})
    late = mf.TransferFunction(poles=2, zeros=0, delay=(0, 0.5))
    with pytest.raises(mf.errors.SpecError, match=r"one per input, mf.Free\(min=0, max=0.5\) for bounds"):
        late.layout(("y",), ("u",))
