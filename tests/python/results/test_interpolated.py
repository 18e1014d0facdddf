"""Outputs that are slower than their record: named, cured by a mask, and silence elsewhere."""

from __future__ import annotations

import flights
import modfun as mf
import numpy as np
import pytest
from modfun.records.slower import drawn as lines
from modfun.records.slower import held as steps
from modfun.records.slower import slow_samples

PLANT, MODEL = mf.tf([4, 8], [1, 1.2, 4]), mf.TransferFunction(poles=2, zeros=1)
T = 0.05 * np.arange(500)


def drawn(kind: str, seed: int, step: int, first: int = 0) -> mf.Record:
    rng = np.random.default_rng(seed)
    if kind == "steps":
        u, word = np.repeat(rng.choice([-1.0, 0.0, 1.0], 20), 25), "zoh"
    else:
        u, word = np.sin(2 * np.pi * (0.05 * T + 0.03 * T**2)), "smooth"
    y = np.ravel(PLANT.simulate(u=u, dt=0.05, intersample=word))
    y += 0.05 * y.std() * rng.standard_normal(500)
    k = np.arange(first, 500, step)
    own = slice(first, k[-1] + 1)
    return mf.Record(y=np.interp(np.arange(500), k, y[k])[own], u=u[own], dt=0.05, intersample=word)


@pytest.mark.parametrize("step", [2, 5])
@pytest.mark.parametrize("kind", ["steps", "chirp"])
def test_lines_are_named_and_the_mask_cures(kind: str, step: int) -> None:
    """In all of 10 records each; of the chirp the numerator was 5 errors off at a step of 5."""
    off = []
    for seed in range(10):
        rec = drawn(kind, seed, step, first=seed % step)
        text = flights.warned(rec, MODEL)[1]
        assert f"straight lines between every {step}" in text
        assert any(f"between every {step}" in one for one in rec.check())
        cured = eval(text.split("leave them out, ")[1].removesuffix("."), {"rec": rec, "np": np})
        assert cured.mask.sum() == np.ceil(rec.t.size / step)
        assert not any("straight lines" in one for one in cured.check())
        fit, after = flights.warned(cured, MODEL)
        assert "straight" not in after
        off.append((fit["b0"] - 4) / fit.bse["b0"])
    assert np.sqrt(np.mean(np.square(off))) < 2.5


def test_of_few_samples_a_slower_record_is_made() -> None:
    """A mask of nine of ten samples left estimates tens of errors off."""
    rec = drawn("chirp", 0, 10)
    text = flights.warned(rec, MODEL)[1]
    cured = eval(text.split("of all channels, ")[1].removesuffix("."), {"rec": rec, "mf": mf})
    assert cured.t.size == 50
    assert cured.dt == pytest.approx(0.5)
    assert not any("straight lines between" in one for one in cured.check())


def test_right_records_are_not_drawn() -> None:
    for seed in range(20):
        rec = flights.flown(seed, nsr=0.05 * (seed % 3))
        assert not any("straight lines between" in one for one in rec.check())
        assert lines(np.round(rec["q"], 3))[0] == 1
    held = np.repeat(np.random.default_rng(0).standard_normal(100), 5)
    ramps = np.ravel(mf.tf([1], [1, 0]).simulate(u=held, dt=0.05, intersample="zoh"))
    rec = mf.Record(y=ramps, u=held, dt=0.05, intersample="zoh")
    assert lines(ramps)[0] == 5  # of an integral
    assert not any("straight lines between" in one for one in rec.check())
    assert lines(held)[0] == 1


@pytest.mark.parametrize("step", [3, 5])
def test_a_vane_that_repeats_its_samples_is_named_and_the_mask_cures(step: int) -> None:
    """Derivatives were 6 to 8 errors off (rms), in silence or with a scale factor or delay blamed."""
    off = []
    for seed in range(4):
        right = flights.flown(seed, nsr=0.05)
        kept = np.repeat(right["alpha"][::step], step)[: right.t.size]
        rec = right.assign(alpha=kept)
        text = flights.warned(rec, flights.SHORT)[1]
        assert f"'alpha' has a new value only every {step}" in text
        assert any("has a new value only" in one for one in rec.check())
        cured = eval(text.split("leave them out, ")[1].removesuffix("."), {"rec": rec, "np": np})
        fit, after = flights.warned(cured, flights.SHORT)
        assert "new value" not in after
        off.append([(fit[name] - value) / fit.bse[name] for name, value in flights.TRUTH.items()])
    assert np.sqrt(np.mean(np.square(off))) < 1.5


def of_held_levels(plant: mf.LTI, every: int = 5, digits: int = 12) -> mf.Record:
    """The response without noise to values that are held for as many samples each, rounded."""
    held = np.repeat(np.random.default_rng(0).standard_normal(100), every)
    y = np.round(np.ravel(plant.simulate(u=held, dt=0.05, intersample="zoh")), digits)
    return mf.Record(y=y, u=held, dt=0.05, intersample="zoh")


@pytest.mark.parametrize(
    ("plant", "digits"),
    [
        (mf.tf([2], [1e-4, 1]), 12),
        (mf.tf([2], [1e-4, 1]), 1),  # rounded
        (mf.tf([2], [1e-4, 1], delay=0.5), 12),
        (mf.tf([2], [1, 0]), 12),
        (mf.tf([2], [1, 0], delay=4.5), 12),
        (mf.tf([2], [1, 0]), 1),
    ],
)
def test_gains_and_integrals_of_held_inputs_are_not_slow(plant: mf.LTI, digits: int) -> None:
    assert not [*slow_samples(of_held_levels(plant, digits=digits), "y")]


@pytest.mark.parametrize("every", [2, 5])
def test_a_ramp_in_coarse_steps_is_rounded(every: int) -> None:
    """It has a new value every so many samples, each one step higher."""
    ramp = np.arange(300) // every * 0.1
    assert steps(ramp)[0] == every
    rec = mf.Record(y=ramp, u=np.sin(0.1 * np.arange(300)), dt=0.05, intersample="smooth")
    assert not [*slow_samples(rec, "y")]


@pytest.mark.parametrize("kept", ["pairs", "third", "half"])
def test_samples_that_a_mask_leaves_do_not_tell_of_others(kept: str) -> None:
    """Of pairs, every fourth change is seen, and those between might be as large."""
    k, rng = np.arange(400), np.random.default_rng(0)
    mask = {"pairs": k % 4 < 2, "third": k % 3 == 0, "half": rng.random(400) < 0.5}[kept]
    rec = mf.Record(y=np.round(rng.standard_normal(400), 1), u=np.sin(0.1 * k), dt=0.05, mask=mask)
    assert not [*slow_samples(rec, "y")]


def test_a_few_masked_samples_leave_it_to_the_others() -> None:
    kept = np.repeat(np.random.default_rng(0).standard_normal(100), 4)
    mask = np.ones(400, np.bool_)
    mask[[50, 51, 202, 333]] = False
    rec = mf.Record(y=np.where(mask, kept, 99.0), u=np.sin(0.1 * np.arange(400)), dt=0.05, mask=mask)
    assert "every 4th sample and repeats it" in next(slow_samples(rec, "y"))


def test_of_a_log_that_is_slow_throughout_its_own_samples_are_taken() -> None:
    """As of a table that was filled forward: input and output have new values at the same times."""
    right = drawn("chirp", 0, 1)
    own = right.y[0, ::5], right.u[0, ::5]
    filled = [np.repeat(one, 5) for one in own]
    for rec, word in (
        (mf.Record(*filled, dt=0.05), "smooth"),
        (mf.Record(*filled, dt=0.05, intersample="zoh"), "zoh"),
    ):
        text = next(slow_samples(rec, "y"))
        cured = eval(text.split("of all channels, ")[1].removesuffix("."), {"rec": rec, "mf": mf})
        assert np.array_equal([cured.y[0], cured.u[0]], own)
        assert cured.intersample == (word,)  # as it looks, or was declared
        assert not [*slow_samples(cured, "y")]


def test_free_motion_has_no_inputs_to_take() -> None:
    t = 0.02 * np.arange(1000)
    y = np.exp(-0.2 * t) * np.cos(2 * t) + 0.01 * np.random.default_rng(0).standard_normal(1000)
    rec = mf.Record(y=np.repeat(y[::10], 10), dt=0.02)
    text = next(slow_samples(rec, "y"))
    cured = eval(text.split("of all channels, ")[1].removesuffix("."), {"rec": rec, "mf": mf})
    assert np.array_equal(cured.y[0], y[::10])
    assert cured.dt == pytest.approx(0.2)


def test_a_long_record_is_told_by_its_first_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise of 2**18 samples is looked at once, and in pieces."""
    sizes, plain = [], np.diff
    monkeypatch.setattr(np, "diff", lambda values, *given: sizes.append(values.size) or plain(values, *given))
    noise = np.random.default_rng(0).standard_normal(2**18)
    assert steps(noise) == lines(noise) == (1, 0)
    assert len(sizes) == 2
    assert max(sizes) < 5000
    assert steps(np.repeat(noise[: 2**14], 16)) == (16, 0)
    assert max(sizes) < 5000


@pytest.mark.parametrize("command", ["random", "step"])
def test_a_command_among_the_outputs_may_have_been_swapped(command):
    """Swapped channels were answered with one more zero, or a delay of the step's own time."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.choice([-1.0, 1.0], 20), 25) if command == "random" else 10.0 * (T > 2)
    y = np.ravel(PLANT.simulate(u=u, dt=0.05, intersample="zoh"))
    y += 0.05 * y.std() * rng.standard_normal(500)
    swapped = mf.Record(y=u, u=y, dt=0.05, outputs=["valve"], inputs=["level"])
    words = "Output 'valve' jumps between 2 values, as a command does, and no input does"
    assert words in str(swapped.check())
    with pytest.warns(mf.ModfunWarning, match=words):
        mf.fit(swapped, MODEL)
    right = mf.Record(y=y, u=u, dt=0.05, outputs=["level"], inputs=["valve"])
    assert "swapped" not in str(right.check())


def test_two_held_channels_and_rounded_ones_are_not_swapped():
    u = np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], 20), 25)
    assert list(slow_samples(mf.Record(y=2 * u, u=u, dt=0.05), "y")) == []
    slow = np.round(np.sin(0.3 * T) + 0.2 * np.random.default_rng(1).standard_normal(500))
    assert not any(
        "swapped" in text for text in slow_samples(mf.Record(y=slow, u=np.sin(0.3 * T), dt=0.05), "y")
    )
