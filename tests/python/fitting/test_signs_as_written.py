"""Minima of other signs that explain a record as well: the signs that users write are likelier."""

import warnings

import modfun as mf
import numpy as np

GENE = "x' = a + V*x**2/(K**2 + x**2) - d*x + u"
TRUTH = {"a": 0.3, "V": 1.5, "K": 1.0, "d": 0.8}


def gene(seed, noise):
    """A gene that activates itself, under a sine that moves it a little."""
    model = mf.Equation(GENE).model(TRUTH)
    return mf.simulate(
        model, input="0.4*sin(0.6*t)", duration=30, intervals=300, initial_state=[0.2], nsr=noise, seed=seed
    )


def fitted(rec, **params):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", mf.ModfunWarning)
        fit = mf.fit(rec, mf.Equation(GENE, params=params))
    return fit, " ".join(str(one.message) for one in caught)


def test_signs_as_written_are_taken_where_others_explain_as_much():
    """In 14 of 20 records V and d were negative in silence, 8 to 20 errors off. Positive ones are right to 4
    errors in all; a fit that had a choice says what else there is, and one bound chooses.
    """
    warned = 0
    for seed in range(10):
        fit, said = fitted(gene(seed, 0.02))
        assert np.all(fit.params > 0)
        assert np.all(np.abs(fit.params - [*TRUTH.values()]) < 4 * fit.bse)
        if said:
            warned += 1
            assert said.startswith("fit: With a = ")
            assert "the model explains the record as well: other signs of parameters" in said
            bound = said.split("params={")[1].split(":")[0].strip("'")
            again, nothing = fitted(gene(seed, 0.02), **{bound: mf.Free(min=0)})
            assert nothing == ""
            np.testing.assert_allclose(again.params, fit.params, rtol=1e-3)
    assert 2 <= warned <= 8


def test_negative_parameters_that_the_record_tells_stay():
    """A decay written as growth."""
    model = mf.Equation("x' = a*b*x + b*u")
    rec = mf.simulate(
        model.model({"a": -0.5, "b": 2.0}), input="sin(t**2/5)", duration=20, intervals=400, nsr=0.02, seed=1
    )
    fit = mf.fit(rec, model)
    assert abs(fit["a"] + 0.5) < 4 * fit.bse["a"]
    assert fit.other_signs is None
