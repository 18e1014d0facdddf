"""Parameters that no record tells apart: said first, wherever the search for them ended."""

import warnings

import modfun as mf
import numpy as np
import pytest

pytestmark = pytest.mark.unit

RATES, GAINS = [["-b/J", "K/J"], ["-K/L", "-R/L"]], [[0], ["1/L"]]
STARTS = {
    "J": mf.Free(0.02, min=1e-4), "b": mf.Free(0.05, min=0), "K": mf.Free(0.2, min=0),
    "R": mf.Free(2.0, min=0), "L": mf.Free(1.0, min=1e-3),
}  # fmt: skip


def speed(seed):
    """The speed of a motor under steps of its voltage."""
    rng = np.random.default_rng(seed)
    motor = mf.ss([[-10, 10], [-0.2, -2]], [[0], [2]], [[1, 0]])
    u = 12 * np.repeat(rng.choice([-1.0, 1.0], 50), 20)[:1000]
    y = np.ravel(motor.simulate(u=u, dt=0.02, intersample="zoh"))
    y = y + 0.05 * y.std() * rng.standard_normal(y.size)
    return mf.Record(y=y, u=u, dt=0.02, outputs=["w"], inputs=["V"], intersample="zoh")


def model(**changed):
    return mf.StateSpace(
        RATES, GAINS, [[1, 0]], states=["w", "i"], inputs=["V"], outputs=["w"], params=STARTS | changed
    )


@pytest.mark.parametrize(("seed", "status"), [(0, "rank"), (1, "maxiter"), (6, "maxiter")])
def test_that_parameters_are_never_told_apart_comes_first(seed, status):
    """Where the search had run to bounds, they were told to lack a state, and that alone."""
    with pytest.warns(mf.ModfunWarning, match="only 3 combination") as said:
        fit = mf.fit(speed(seed), model())
    assert fit.status == status
    assert len(said) == 1
    (only,) = fit.check()
    assert only.startswith("The equations do not tell their parameters apart, whatever the record")


def test_two_numbers_are_enough_and_so_is_what_was_known_before():
    for told in ({"R": 1.0, "L": 0.5}, {"R": mf.Free(1.0, sd=0.01), "L": mf.Free(0.5, sd=0.005)}):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mf.ModfunWarning)
            fit = mf.fit(speed(1), model(**told))
        assert "tell their parameters apart" not in str(fit.check())


def test_a_bound_of_equations_that_tell_is_another_matter():
    held = model(R=1.0, L=0.5, b=mf.Free(0.2, min=0.15))
    with pytest.warns(mf.ModfunWarning, match="ended on"):
        mf.fit(speed(1), held)
