"""StateSpace with delayed inputs: fits, bounds and predictions against samples shifted by hand."""

import pickle
import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.linalg import expm

TRUTH = {"Za": -0.8, "Ma": -4.5, "Mq": -1.2, "Zd": -0.1, "Md": -5.0}
DT, LATE = 0.02, 0.06
NAMES = {"states": ["alpha", "q"], "inputs": ["de"]}


def motion(**words):
    return mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], **NAMES, **words)


def stepped(u, x0=(0.0, 0.0), late=LATE):
    """The states by the exponential of the matrices, of an input held between samples and `late`."""
    a = np.array([[TRUTH["Za"], 1], [TRUTH["Ma"], TRUTH["Mq"]]])
    b = np.array([[TRUTH["Zd"]], [TRUTH["Md"]]])
    step = expm(np.block([[a, b], [np.zeros((1, 3))]]) * DT)
    shift = round(late / DT)
    moved = np.concatenate([np.full(shift, u[0]), u])
    x = [np.asarray(x0, dtype=float)]
    for k in range(u.size - 1):
        x.append(step[:2, :2] @ x[-1] + step[:2, 2] * moved[k])
    return np.array(x).T


def doublets(size=500):
    t = np.arange(size) * DT
    u = np.where((t > 1) & (t < 1.6), 0.05, 0) - np.where((t >= 1.6) & (t < 2.1), 0.05, 0)
    return u + np.where((t > 5) & (t < 5.7), 0.04, 0) - np.where((t >= 5.7) & (t < 6.0), 0.04, 0)


def flown(seed, nsr=0.05, **words):
    u = doublets()
    y = stepped(u, **words)
    y += nsr * y.std(axis=1, keepdims=True) * np.random.default_rng(seed).normal(size=y.shape)
    return mf.Record(y=y, u=u, dt=DT, outputs=["alpha", "q"], inputs=["de"], intersample="zoh")


def test_a_delay_is_known_or_estimated():
    """40 records; of 240 errors within 95 % intervals fewer than 214 have a probability below 1e-4."""
    free = motion(delay="tau", params={"tau": mf.Free(min=0, max=0.2)})
    truth = {**TRUTH, "tau": LATE}
    inside = []
    for seed in range(40):
        fit = mf.fit(flown(seed), free)
        low, high = fit.conf_int().T
        inside += [low[k] < truth[name] < high[k] for k, name in enumerate(fit.param_names)]
    assert len(inside) == 240
    assert np.sum(inside) >= 214
    known = mf.fit(flown(0), motion(delay=LATE))
    assert known.param_names == tuple(TRUTH)
    assert all(abs(known[name] - value) < 4 * known.bse[name] for name, value in TRUTH.items())
    held = mf.fit(flown(0), motion(delay="tau", params={"tau": LATE}))
    np.testing.assert_allclose(held.params, known.params, rtol=1e-10)


def test_a_delay_agrees_with_the_equation_that_has_it():
    rec = flown(3)
    equation = mf.Equation(
        ["alpha' = Za*alpha + q + Zd*de(t - tau)", "q' = Ma*alpha + Mq*q + Md*de(t - tau)"],
        outputs=["alpha", "q"],
        inputs=["de"],
        params={"tau": mf.Free(min=0, max=0.2)},
    )
    one = mf.fit(rec, motion(delay="tau", params={"tau": mf.Free(min=0, max=0.2)}))
    other = mf.fit(rec, equation, trend="constant")
    for name in other.param_names:
        assert abs(one[name] - other[name]) < 1e-6 * abs(other[name]) + 1e-9


def test_the_response_is_that_of_shifted_samples():
    rec = flown(0, nsr=0.0)
    model = motion(delay="tau").model({**TRUTH, "tau": LATE})
    assert model.delays == (LATE,)
    np.testing.assert_allclose(model.simulate(u=rec.u, dt=DT, intersample="zoh"), rec.y, atol=1e-12)
    fit = mf.fit(flown(1, x0=(0.02, -0.01)), motion(delay=LATE))
    far = (fit.predict().y - stepped(doublets(), x0=(0.02, -0.01))) / rec.y.std(axis=1, keepdims=True)
    assert np.abs(far).max() < 0.05


def test_a_known_start_and_a_delay_go_together():
    model = motion(delay=LATE)
    plain, rest = mf.fit(flown(4), model), mf.fit(flown(4), model, initial_state="rest")
    assert all(abs(rest[name] - value) < 4 * rest.bse[name] for name, value in TRUTH.items())
    assert np.all(np.asarray(rest.bse) < 1.02 * np.asarray(plain.bse))
    moving = mf.fit(flown(4, x0=(0.02, -0.01)), model, initial_state=[0.02, -0.01])
    assert all(abs(moving[name] - value) < 4 * moving.bse[name] for name, value in TRUTH.items())


def test_the_bound_has_the_derivative_to_the_delay():
    smooth = np.sin(np.arange(500) * DT * 2.0) * np.sin(np.arange(500) * DT * 0.3)
    rec = mf.Record(y=np.zeros((2, 500)), u=smooth, dt=DT, outputs=["alpha", "q"], inputs=["de"])
    free, values = motion(delay="tau", params={"tau": mf.Free(min=0, max=0.2)}), {**TRUTH, "tau": LATE}
    bound = mf.crlb(free, rec, params=values, sigma=0.01, initial_state="rest")
    rows = []
    for name, value in values.items():
        sides = []
        for sign in (1, -1):
            own = free.model({**values, name: value + sign * 1e-5 * abs(value)})
            sides.append(own.simulate(u=rec.u, dt=DT, intersample="smooth"))
        rows.append((sides[0] - sides[1]).ravel() / (2e-5 * abs(value)))
    sd = 0.01 * np.sqrt(np.diag(np.linalg.inv(np.array(rows) @ np.array(rows).T)))
    np.testing.assert_allclose(bound.sd, sd, rtol=2e-3)
    assert bound.param_names == tuple(values)


def test_a_missing_delay_is_the_first_cure():
    for seed in range(3):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", mf.ModfunWarning)
            mf.fit(flown(seed), motion())
        text = str(caught[0].message)
        assert "First try a delay of de, delay='h' and params={'h': mf.Free(min=0, max=...)} (h = 0.0" in text
        assert abs(float(text.split("(h = ")[1].split(" s)")[0]) - LATE) < 0.01


def test_delays_are_kept_by_what_is_made_of_the_model():
    model = motion(delay="tau", params={"tau": mf.Free(min=0, max=0.2)})
    assert str(model).startswith("alpha' = Za*alpha + q + Zd*de(t - tau)")
    assert model.param_names() == (*TRUTH, "tau")
    assert mf.StateSpace.from_dict(model.to_dict()) == model == pickle.loads(pickle.dumps(model))
    assert model != motion()
    assert "delay=['tau']" in repr(model)
    assert "delay" not in repr(motion())
    values = [*TRUTH.values(), 0.06]
    np.testing.assert_allclose(model.theta(model.model(values)), values)
    assert model.without("q").delay == ("tau",)
    seen = mf.through(model, sensor={"q": mf.tf([1], [0.1, 1])})
    assert seen.delay == ("tau",)
    two = mf.StateSpace([["a"]], [["b", "c"]], delay=[0.0, "h"], params={"h": mf.Free(min=0, max=1)})
    assert str(two) == "x1' = a*x1 + b*u1 + c*u2(t - h)"


@pytest.mark.parametrize(
    ("delay", "said"),
    [
        (-0.1, "the delay of de is -0.1; give seconds of at least 0"),
        ("2*tau", "the delay of de is '2*tau'; give seconds"),
        ([0.1, 0.2], "delay has shape"),
        (mf.Free(min=0, max=1), "delay[0][0] is"),
        (np.nan, "entries are finite"),
    ],
)
def test_wrong_delays_are_refused(delay, said):
    with pytest.raises(mf.SpecError) as caught:
        motion(delay=delay)
    assert said in str(caught.value)


def test_a_delay_without_bounds_is_refused():
    with pytest.raises(
        mf.SpecError, match=r"'tau' is a delay .* no largest value; .* mf.Free\(min=0, max=0.5\)"
    ):
        mf.fit(flown(0), motion(delay="tau"))
