"""Vanes in the upwash or off the reference point, beside numbers of equations that explain as much."""

import modfun as mf
from flights import SHORT, SPEED, TRUTH, flown, warned
from test_votes import SIDES, side

PLACED = mf.StateSpace(
    [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], [[1, "tau"], [0, 1]], [[0], [0]],
    states=["a", "rate"], inputs=["de"], outputs=["alpha", "q"],
)  # fmt: skip


def test_of_a_vane_in_the_upwash_its_factor_is_named_before_a_number():
    """The record does not tell them apart, and of the number the derivatives are of another aircraft."""
    for seed in range(3):
        rec = flown(seed, alpha=1.15)
        text = warned(rec, SHORT)[1]
        assert "does not tell these apart, whose derivatives differ: a factor of 1.1" in text
        first = text.split("rec.assign(")[1].split(")")[0]
        assert first.startswith("alpha=rec['alpha']/1.1")
        fit, text = warned(eval(f"rec.assign({first})"), SHORT)
        assert text == ""
        assert abs(fit["Ma"] - TRUTH["Ma"]) < 5 * fit.bse["Ma"]


def test_a_vane_ahead_is_named_where_a_number_in_the_equations_explains_as_much():
    for seed in range(3):
        rec = flown(seed)
        text = warned(rec.assign(alpha=rec["alpha"] - 5 / SPEED * rec["q"]), SHORT)[1]
        lever, error = (float(x) for x in text.split("alpha shows ")[1].split(" times q")[0].split(" ± "))
        assert abs(lever + 5 / SPEED) < 4 * error
        assert "the row of alpha and the column of q in C" in text


def test_a_vane_ahead_is_named_alone_where_a_bank_angle_tells_it_from_a_number():
    rec = side(1, aileron=0.04, rudder=0.05)
    text = warned(rec.assign(beta=rec["beta"] + 0.1 * rec["r"]), SIDES)[1]
    assert "seems to be off" in text
    assert "beta shows 0.1" in text or "beta shows 0.09" in text
    assert "the row of beta and the column of r in C" in text


def test_the_place_of_a_vane_in_the_model_leaves_nothing_to_say():
    for seed in range(3):
        rec = flown(seed)
        fit, text = warned(rec.assign(alpha=rec["alpha"] - 5 / SPEED * rec["q"]), PLACED)
        assert text == ""
        assert abs(fit["Za"] - TRUTH["Za"]) < 5 * fit.bse["Za"]
