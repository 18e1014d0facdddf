"""What fits of several records say where these are of more than one system."""

import modfun as mf
import pytest
from flights import SHORT, TRUTH, WRITTEN, flown, warned

FASTER = {**TRUTH, "Ma": -8.0, "Md": -10.0}
CLOSE = {name: 1.15 * value for name, value in TRUTH.items()}
TF = mf.TransferFunction(poles=2, zeros=0)


@pytest.mark.parametrize("model", [SHORT, WRITTEN])
def test_two_flight_conditions_in_one_list_are_named(model):
    """With estimates of each within four errors: one set of 80 in 200 would not be."""
    for seed in range(20):
        fit, text = warned([flown(2 * seed), flown(2 * seed + 1, truth=FASTER)], model)
        assert "The records disagree on the parameters" in text
        assert any(text.removeprefix("fit: ") == one for one in fit.check())
        name = "Ma" if "Ma is " in text else "Md"
        said = text.split(f"{name} is ")[1]
        for part, truth, record in zip(said.split(" and ")[:2], (TRUTH, FASTER), (0, 1), strict=True):
            value, error = (float(one.strip(",.")) for one in part.replace("±", "").split()[:2])
            assert abs(value - truth[name]) < 4.5 * error
            assert f"in record {record}" in part


def test_one_of_three_records_with_all_derivatives_larger_is_named():
    for seed in range(20):
        records = [flown(3 * seed), flown(3 * seed + 1), flown(3 * seed + 2, truth=CLOSE)]
        text = warned(records, SHORT)[1]
        assert "The records disagree on the parameters" in text
        assert "in record 2" in text


def test_records_of_two_plants_are_named_for_transfer_functions():
    for seed in range(20):
        records = [
            mf.simulate(
                mf.tf([5], [1, 3, stiff]), input="sin(t**2/5)", duration=10, intervals=256, nsr=0.05,
                initial_state=[0.6, -2], seed=2 * seed + k,
            )
            for k, stiff in enumerate((8, 10))
        ]  # fmt: skip
        text = warned(records, TF)[1]
        assert "The records disagree on the parameters" in text
        assert "a2 is " in text


@pytest.mark.parametrize(("model", "count"), [(SHORT, 2), (SHORT, 5), (WRITTEN, 3)])
def test_lists_of_one_condition_are_not_warned_of(model, count):
    """Records of their own lengths and levels of noise; a rate of 6 % would be seen with 95 %."""
    for seed in range(50):
        records = [
            flown(1000 + 7 * seed + k, nsr=0.02 + 0.02 * (k % 2), duration=12.0 + 2 * (k % 2))
            for k in range(count)
        ]
        assert warned(records, model)[1] == ""


def test_what_is_wrong_in_every_record_is_no_disagreement():
    for seed in range(10):
        records = [flown(2 * seed + k, nsr=0.02, lag=0.08) for k in range(2)]
        assert "a lag of the sensor of alpha" in warned(records, SHORT)[1]
        records = [flown(2 * seed + k, colour=0.9) for k in range(2)]
        assert warned(records, SHORT)[1] == ""
