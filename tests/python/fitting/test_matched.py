"""State spaces without starts: parameters are matched to coefficients where the search from others fails."""

import warnings
from dataclasses import replace

import modfun as mf
import numpy as np
import pytest
from modfun.equations.symbolic.freed import freed
from scipy.linalg import expm

L, J, B = 0.004, 3e-4, 2e-4
MOTOR = {"R": 1.2, "K": 0.06}
J1, J2, C, D, B1 = 0.01, 0.03, 40.0, 0.05, 0.02


def moved(a, b, u, x, dt):
    """States under held inputs."""
    n = len(a)
    step = expm(dt * np.vstack([np.hstack([a, b]), np.zeros((1, n + 1))]))
    found = []
    for value in u:
        found.append(x)
        x = step[:n, :n] @ x + step[:n, n] * value
    return np.array(found).T


def noisy(y, rng):
    return y + 0.02 * np.std(y) * rng.standard_normal(y.size)


def run(seed):
    """The speed of a DC motor under a random binary voltage of 12 V."""
    rng = np.random.default_rng(seed)
    u = 12 * np.repeat(rng.choice([-1, 1], 61), 25)[:1500]
    a = np.array([[-1.2 / L, -0.06 / L], [0.06 / J, -B / J]])
    y = moved(a, [[1 / L], [0]], u, np.array([0.0, 50.0 * rng.standard_normal()]), 0.001)[1]
    return mf.Record(y=noisy(y, rng), u=u, dt=0.001, outputs=["w"], inputs=["V"])


def motor(**params):
    return mf.StateSpace(
        [["-R/L", "-K/L"], ["K/J", "-b/J"]],
        [["1/L"], [0]],
        [[0, 1]],
        states=["i", "w"],
        inputs=["V"],
        params=MOTOR | params,
    )


def drive(seed):
    """The motor's speed of a drive of two masses."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1, 1], 251), 8)[:2000].astype(float)
    a = np.array([[-(D + B1) / J1, D / J1, -C / J1], [D / J2, -D / J2, C / J2], [1, -1, 0]])
    y = moved(a, [[1 / J1], [0], [0]], u, np.array([1.0, 1.0, 0.0]) * rng.standard_normal(), 0.002)[0]
    return mf.Record(y=noisy(y, rng), u=u, dt=0.002, outputs=["w1"], inputs=["M"])


MASSES = mf.StateSpace(
    [["-(d+b1)/J1", "d/J1", "-c/J1"], ["d/J2", "-d/J2", "c/J2"], [1, -1, 0]],
    [["1/J1"], [0], [0]],
    [[1, 0, 0]],
    states=["w1", "w2", "phi"],
    inputs=["M"],
)
WRITTEN = mf.Equation(
    ["J1*w1' = -(d+b1)*w1 + d*w2 - c*phi + M", "J2*w2' = d*w1 - d*w2 + c*phi", "phi' = w1 - w2"],
    outputs=["w1"],
    inputs=["M"],
)


def right(fit, **true):
    assert fit.status == "ok"
    assert not fit.at_bound
    for name, value in true.items():
        assert abs(fit[name] - value) < 4.5 * fit.bse[name], name


@pytest.mark.filterwarnings("ignore:fit. With L = .* the equations are the same")  # as they are
@pytest.mark.parametrize("bounds", [{"min": 0}, {"min": 0, "max": 1}])
@pytest.mark.parametrize("seed", [2, 3, 5, 8, 12])
def test_a_bound_at_which_a_matrix_has_no_value_is_the_one_that_was_given(seed, bounds):
    """1/J has no value at 0, and 0.001 was the bound instead: 20 of 20 records ended there."""
    free = mf.Free(**bounds)
    right(mf.fit(run(seed), motor(L=free, J=free, b=free)), L=L, J=J, b=B)


@pytest.mark.parametrize("seed", [0, 1, 6, 21, 24, 25])
def test_a_motor_is_found_without_starts(seed):
    """In 5 of 40 records J went to infinity, and nothing told the parameters apart there."""
    right(mf.fit(run(seed), motor()), L=L, J=J, b=B)


@pytest.mark.parametrize(("seed", "model"), [
    (0, MASSES), (9, MASSES), (14, MASSES), (0, WRITTEN), (12, WRITTEN), (18, WRITTEN),
])  # fmt: skip
def test_a_drive_of_two_masses_is_found_without_starts(seed, model):
    """J2 = -11304 after 11 s, or 13 with its errors 16, or no answer, in 6 of 45."""
    right(mf.fit(drive(seed), model), J1=J1, J2=J2, c=C, d=D, b1=B1)


def test_of_two_sets_with_the_same_equations_that_near_the_starts_is_taken():
    """L = 1.8 and J = 6.7e-7 say the same of the speed: both time constants exchanged."""
    starts = {"L": mf.Free(0.002, min=0), "J": mf.Free(1e-4, min=0), "b": mf.Free(1e-4, min=0)}
    right(mf.fit(run(12), motor(**starts)), L=L, J=J, b=B)
    starts = {"L": mf.Free(2.0, min=0), "J": mf.Free(1e-6, min=0), "b": mf.Free(1e-4, min=0)}
    other = mf.fit(run(12), motor(**starts))
    right(other, L=1.785, J=6.70e-7, b=B)
    assert any("are the same" in text for text in other.check())


def test_a_bound_that_holds_is_named_as_given():
    free = {"L": mf.Free(L), "J": mf.Free(J), "b": mf.Free(min=1e-3)}
    with pytest.warns(mf.ModfunWarning, match=r"b ended on a bound: .* elsewhere than at min=0\.001, and"):
        fit = mf.fit(run(1), motor(**free))
    assert fit.at_bound == ("b",)


def test_a_fit_that_cannot_tell_parameters_apart_asks_for_starts_where_it_had_none():
    fit = replace(mf.fit(run(1), motor(b=B)), status="rank")
    assert "give starts, params={'L': mf.Free(...), 'J': mf.Free(...)}" in fit.message
    told = replace(mf.fit(run(1), motor(b=B, L=mf.Free(L), J=mf.Free(J))), status="rank")
    assert "give starts" not in told.message
    linear = mf.Equation("w'' + a*w' + b*w = c*V", outputs=["w"], inputs=["V"])
    assert "give starts" not in replace(mf.fit(run(1), linear), status="rank").message


def test_coefficients_are_free_only_of_linear_equations_without_free_delays():
    compiled = motor().compiled()
    own = freed(compiled, None)
    assert len(own.coefficients) == 3
    theta = [L, J, B]
    given = own.functions[0](np.array(theta))
    unbounded = np.full(3, np.inf)
    cov = np.diag((0.001 * given) ** 2)
    found = own.nearest(given, cov, np.array([0.04, 2e-4, 5e-3]), -unbounded, unbounded)
    assert found == pytest.approx(theta, rel=1e-6)
    late = mf.Equation(
        "J*w' + b*w = V(t - h)",
        outputs=["w"],
        inputs=["V"],
        params={"h": mf.Free(min=0, max=0.1)},
    )
    assert freed(late.compiled(), None) is None
    bent = mf.Equation("J*w' + b*w + c*w**3 = V", outputs=["w"], inputs=["V"])
    assert freed(bent.compiled(), None) is None


@pytest.mark.parametrize("lost", ["masked", "uneven"])
def test_what_is_lost_of_a_record_raises_no_error_of_the_code(lost):
    """Free coefficients have no response that could stand for masked samples."""
    for seed in (0, 6, 21):
        rec, rng = run(seed), np.random.default_rng(seed)
        kept = np.sort(rng.choice(1500, 1350, replace=False)) if lost == "uneven" else np.arange(1500)
        mask = rng.random(1500) > 0.1 if lost == "masked" else None
        rec = mf.Record(
            y=rec.y[0, kept],
            u=rec.u[0, kept],
            t=rec.t[kept],
            outputs=["w"],
            inputs=["V"],
            mask=mask,
            intersample="zoh",
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = mf.fit(rec, motor())
        assert fit.status in ("ok", "rank", "maxiter")
        if fit.status == "ok":
            right(fit, L=L, J=J, b=B)
