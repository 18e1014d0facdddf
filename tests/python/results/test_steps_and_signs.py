"""What fits say of a wrong time step, of a sign that nothing tells, and of equations that tell too little."""

import modfun as mf
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
