"""Records of one list of which one has a wrong time step are named, with the step that they should have."""

import modfun as mf
import pytest
from flights import SHORT, flown, warned

TF = mf.TransferFunction(poles=2, zeros=0)
LAGGED = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=0.4))


def moved(seed, poles, delay=0.0, duration=10.0, intervals=500):
    return mf.simulate(
        mf.tf([5.0], poles, delay=delay), input="sign(sin(t**2/8))", intersample="zoh", duration=duration,
        intervals=intervals, nsr=0.03, seed=seed,
    )  # fmt: skip


def slipped(rec, factor):
    return mf.Record(
        y=rec.y, u=rec.u, dt=rec.dt * factor, outputs=rec.outputs, inputs=rec.inputs,
        intersample=rec.intersample,
    )  # fmt: skip


def three(seed, model):
    if model is SHORT:
        return [flown(seed + 50 * k, duration=12.0 + 2 * k) for k in range(3)]
    poles, late = ([1, 3, 8], 0.0) if model is TF else ([1, 3], 0.1)
    return [moved(seed + 50 * k, poles, late, 10.0 + k) for k in range(3)]


@pytest.mark.parametrize("factor", [0.1, 10.0, 2.0])
@pytest.mark.parametrize("model", [TF, LAGGED, SHORT])
@pytest.mark.parametrize("k", [0, 1, 2])
def test_the_record_is_named_with_its_step(model, factor, k):
    """Actuators that saturate were blamed: each record alone was fitted over the band of all."""
    found = 0
    for seed in range(2):
        records = three(seed, model)
        step = records[k].dt
        records[k] = slipped(records[k], factor)
        text = warned(records, model)[1]
        found += f"Record {k} contradicts the others: " in text and f"First try dt={step:.6g} for" in text
    assert found == 2


def test_of_two_records_none_is_said_to_be_the_wrong_one():
    records = [moved(1, [1, 3, 8]), slipped(moved(2, [1, 3, 8]), 0.1)]
    text = warned(records, TF)[1]
    assert "Record 0 contradicts record 1: " in text
    assert "times slower. Are both time steps right? First try dt=0.002 for record 0 in place of 0.02" in text
    assert ", or dt=0.02 for record 1 in place of 0.002: with either both agree, and they do not tell" in text


def test_records_with_steps_of_their_own_are_right():
    for seed in range(20):
        records = [moved(3 * seed + k, [1, 3, 8], 0, 10, n) for k, n in enumerate((250, 500, 1000))]
        assert warned(records, TF)[1] == ""


def test_a_faster_system_is_no_slip():
    """Twice the speed doubles the poles, and the gain, too."""
    fast = mf.simulate(
        mf.tf([40.0], [1, 6, 32]), input="sign(sin(t**2/8))", intersample="zoh", duration=10.0, intervals=500,
        nsr=0.03, seed=9,
    )  # fmt: skip
    text = warned([moved(1, [1, 3, 8]), moved(2, [1, 3, 8]), fast], TF)[1]
    assert text
    assert "contradicts" not in text
