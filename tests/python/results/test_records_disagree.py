"""What fits of several records say where these are of more than one system."""

import modfun as mf
import numpy as np
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


@pytest.mark.parametrize("model", [SHORT, WRITTEN])
@pytest.mark.parametrize(
    ("channel", "factor", "words"),
    [
        ("q", 180 / np.pi, "57.3 times what the rest of the list predicts"),
        ("alpha", np.pi / 180, "0.0175 times what the rest of the list predicts"),
        ("de", 180 / np.pi, "57.3 times what the rest of the list predicts"),
        ("q", -1.0, "of the opposite sign"),
        ("alpha", 1.3, "1.3 times what the rest of the list predicts"),
    ],
)
def test_a_channel_of_one_record_in_another_unit_or_sign_is_named_with_its_record(
    model, channel, factor, words
):
    """Whether the fit of all settles, as by a level of noise of that record, or fails."""
    for seed in range(2):
        records = [flown(3 * seed + k) for k in range(3)]
        k = 2 - seed
        records[k] = records[k].assign(**{channel: factor * records[k][channel]})
        fit, text = warned(records, model)
        assert f"{channel} of record {k} is {words}" in text
        cure = text.split("First try ")[1].rstrip(".")
        records[k] = eval(cure, {"records": records, "np": np})
        fit, text = warned(records, model)
        assert text == ""
        assert abs(fit["Ma"] - TRUTH["Ma"]) < 5 * fit.bse["Ma"]


@pytest.mark.parametrize(("channel", "late"), [("alpha", 2), ("alpha", 1), ("q", -2), ("de", 2)])
def test_a_channel_late_in_one_record_is_named_with_its_record(channel, late):
    for seed in range(2):
        records = [flown(3 * seed + k) for k in range(3)]
        rec = records[1]
        own = rec.window(rec.t[max(late, 0)], rec.t[min(late, 0) - 1])
        moved = rec[channel][:-late] if late > 0 else rec[channel][-late:]
        records[1] = own.assign(**{channel: moved})
        text = warned(records, SHORT)[1]
        assert f"{channel} of record 1 seems to be recorded " in text
        found, error = (float(part.split()[0]) for part in text.split("recorded ")[1].split(" ± "))
        assert abs(found - 0.02 * abs(late)) < 5 * error
        assert f"samples) {'late' if late > 0 else 'early'} beside" in text
        sign = "+" if late > 0 else "-"
        assert f"np.interp(records[1].t {sign} {0.02 * abs(late):.4g}, " in text


def test_several_records_with_a_channel_in_another_unit_are_named():
    for seed in (0, 4):
        records = [flown(5 * seed + k) for k in range(5)]
        off = [rec.assign(q=57.3 * rec["q"]) if k in (1, 3) else rec for k, rec in enumerate(records)]
        fit, text = warned(off, SHORT)
        assert "q of records 1 and 3 is 57.3 times" in text
        assert "First try rec.assign(q=rec['q']/57.3) for these." in text
        assert text.removeprefix("fit: ") == next(iter(fit.check()))
        off[3] = records[3].assign(alpha=-records[3]["alpha"])
        text = warned(off, SHORT)[1]
        assert "q of record 1 is 57.3 times" in text
        assert "; alpha of record 3 is of the opposite sign." in text


def test_of_two_records_of_a_transfer_function_the_one_in_degrees_is_named():
    """Each alone is explained; a factor of the output is as good as the inverse one of the input."""
    for k in range(2):
        records = [
            mf.simulate(
                mf.tf([5], [1, 3, 8]), input=text, duration=20, intervals=512, nsr=0.05,
                initial_state=[0.6, -2], seed=seed,
            )
            for seed, text in enumerate(("sin(t**2/5)", "sin(t**2/7+1)"))
        ]  # fmt: skip
        records[k] = records[k].assign(y=180 / np.pi * records[k]["y"])
        text = warned(records, TF)[1]
        assert f"y of record {k} is 57.3 times what the rest of the list predicts" in text
        assert "the inverse change of u would do the same" in text


def test_a_record_alone_is_diagnosed_where_the_others_are_explained():
    records = [flown(k) for k in range(3)]
    drift = records[1].assign(alpha=records[1]["alpha"] + 0.05 * records[1].t / 16)
    text = warned([records[0], drift, records[2]], SHORT)[1]
    assert "Record 1 contradicts the model, and the others leave only the noise." in text
    assert 'First try trend="linear"' in text
    text = warned([records[0], records[2], flown(1, gust=0.02)], SHORT)[1]
    assert "Record 2 contradicts the model, and the others leave only the noise." in text
    assert "seems to drive the equations" in text


def test_lists_of_three_unlike_manoeuvres_stay_silent():
    """Noise of 2, 5 and 10 %, lengths and sizes of their own, in 30 of 30."""
    for seed in range(30):
        records = [
            flown(500 + 3 * seed + k, nsr=nsr, duration=duration)
            for k, (nsr, duration) in enumerate(((0.02, 12.0), (0.05, 16.0), (0.1, 14.0)))
        ]
        assert warned(records, SHORT)[1] == ""


def mended(records, cure):
    """The records with the change that a message names."""
    change, _, where = cure.partition(" for records ")
    chosen = [int(k) for k in where.split(" and ")] if where else [int(change[8])]
    changed = {k: eval(change, {"records": records, "rec": records[k], "np": np}) for k in chosen}
    return [changed.get(k, rec) for k, rec in enumerate(records)]


@pytest.mark.parametrize(("count", "off"), [(2, (0,)), (2, (1,)), (4, (0, 3)), (4, (1, 2))])
@pytest.mark.parametrize("factor", [-1.0, 1 / 1.3, 1.3])
def test_of_as_many_records_neither_side_is_said_to_be_wrong(count, off, factor):
    """The first, or the larger one, was named with confidence: derivatives of the other sign, in silence."""
    for seed in range(2):
        records = [flown(4 * seed + k) for k in range(count)]
        for k in off:
            records[k] = records[k].assign(de=factor * records[k]["de"])
        text = warned(records, SHORT)[1]
        tells = (
            "two records do not tell which is wrong" if count == 2 else "as many do not tell which are wrong"
        )
        assert tells in text
        first, second = text.rstrip(".").split("; then ")[1].split(" or ")
        if factor < 0:
            assert "are of opposite signs" in text
            sides = [set(range(count)) - set(off), set(off)]
            here, there = (
                {int(k) for k in one.replace("records[", " ").replace("]", " ").split() if k.isdigit()}
                for one in (first, second)
            )
            assert {frozenset(here), frozenset(there)} == {frozenset(one) for one in sides}
            second = first
        for cure in (first, second):
            assert warned(mended(records, cure), SHORT)[1] == ""


def test_two_of_five_records_with_an_elevator_of_the_other_sign_are_named():
    """One at a time was left out: the message was of flight conditions."""
    for seed in range(4):
        records = [flown(5 * seed + k) for k in range(5)]
        for k in (1, 4):
            records[k] = records[k].assign(de=-records[k]["de"])
        text = warned(records, SHORT)[1]
        assert "de of records 1 and 4 is of the opposite sign. First try rec.assign(de=-rec['de'])" in text
