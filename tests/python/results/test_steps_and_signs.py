"""What fits say of a wrong time step, of a sign that nothing tells, and of equations that tell too little."""

import modfun as mf
import numpy as np
from flights import SHORT, flown, warned


def test_a_time_step_twice_too_long_is_named_first():
    for seed in range(3):
        rec = flown(seed, nsr=0.02)
        slow = mf.Record(
            {name: rec[name] for name in rec.outputs}, {"de": rec["de"]}, dt=0.04, intersample="smooth"
        )
        text = warned(slow, SHORT)[1]
        assert "First look at the time step, which would be 0.02 s and not 0.04 s" in text


def test_a_number_that_no_time_step_explains_has_none():
    for seed in range(3):
        text = warned(flown(seed, nsr=0.02, alpha=1.6), SHORT)[1]
        assert "A number in the equations contradicts the record" in text
        assert "time step" not in text


def test_two_channels_with_one_number_between_them_are_both_said_to_have_the_wrong_sign():
    """It was always alpha first, though q was recorded with the other sign."""
    for seed in range(3):
        text = warned(flown(seed, nsr=0.02, q=-1.0), SHORT)[1]
        assert "alpha or q seems to be of the opposite sign, the record does not tell which" in text
        assert text.endswith("First try rec.assign(alpha=-rec['alpha']), or rec.assign(q=-rec['q']).")


def test_a_fit_whose_equations_do_not_tell_its_parameters_says_which():
    rec = flown(0)
    fit, text = warned(rec, SHORT.without("alpha"))
    assert fit.status == "rank"
    assert "Za, Ma, Mq and Zd: only 3 combination(s) of these 4 can be found" in text
    assert not warned(rec, SHORT.without("alpha")._like(params={"Zd": -0.12}))[1]


PHUGOID = mf.Equation(
    ["V' = Xu*V - 9.81*theta", "theta' = Zu*V + Zt*theta + Zd*de"], outputs=["V", "theta"], inputs=["de"]
)


def phugoid(seed: int, *, speed: float = 1.0, dt: float = 0.5) -> mf.Record:
    """A slow sum of sines of the elevator, 3 % noise; the factor of the speed, and the step that is told."""
    rng, t = np.random.default_rng(seed), 0.5 * np.arange(801)
    u = 0.05 * np.sin(2 * np.pi * np.outer(t, np.geomspace(0.004, 0.08, 8)) + rng.uniform(0, 6.28, 8)).sum(1)
    plant = mf.ss([[-0.02, -9.81], [0.0012, -0.01]], [[0.0], [0.02]], np.eye(2))
    clean = plant.simulate(u=u, dt=0.5, intersample="smooth")
    noisy = clean + 0.03 * clean.std(axis=1, keepdims=True) * rng.standard_normal(clean.shape)
    return mf.Record({"V": speed * noisy[0], "theta": noisy[1]}, {"de": u}, dt=dt, intersample="smooth")


def test_a_speed_in_knots_is_named_and_a_step_of_half_the_size_is_not_taken_for_it():
    """Knots are 1.94 m/s: a number was said to contradict the record, 1.94 times 9.81."""
    for seed in range(6):
        text = warned(phugoid(seed, speed=1 / 0.5144), PHUGOID)[1]
        assert "V seems to be in knots and not in m/s, 1.94 times what the equations need" in text
        assert "First try rec.assign(V=rec['V']/1.944)" in text
        assert "knots" not in warned(phugoid(seed, dt=0.25), PHUGOID)[1]
        assert warned(phugoid(seed), PHUGOID)[1] == ""
