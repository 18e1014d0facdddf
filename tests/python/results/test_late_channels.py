"""What fits of equations say where a channel was recorded late or early, and that its cure works."""

import re
import warnings

import modfun as mf
import numpy as np
import pytest
import scipy
from flights import SHORT, WRITTEN, off, warned
from modfun.results.shifts import likeliest_shift

PLANT = mf.ss([[-0.9, 1], [-5.2, -1.4]], [[-0.12], [-7.5]], np.eye(2), np.zeros((2, 1)))
PARTS = 4  # of a sample, in which channels may be late


def flown(seed, nsr=0.02, dt=0.02, word="smooth", **late):
    """Two doublets of a surface behind an actuator, or held; channels late by so many samples."""
    t = np.arange(0, 16 + dt / 8, dt / PARTS)
    u = 0.05 * (1.0 * (t > 1) - 2 * (t > 1.9) + (t > 2.5)) + 0.04 * (1.0 * (t > 7) - 2 * (t > 8) + (t > 9))
    if word == "smooth":
        u = np.ravel(mf.ss([[-20]], [[20]], [[1]]).simulate(u=u, dt=dt / PARTS, intersample="zoh"))
    else:
        u = np.repeat(u[::PARTS], PARTS)[: t.size]
    y = PLANT.simulate(u=u, dt=dt / PARTS, intersample=word)
    rows = {}
    for name, row in {"alpha": y[0], "q": y[1], "de": u}.items():
        shift = round(late.get(name, 0) * PARTS)
        rows[name] = np.interp(t - shift * dt / PARTS, t, row)[::PARTS] if word == "smooth" else None
        if rows[name] is None:
            rows[name] = row[::PARTS][np.clip(np.arange(row[::PARTS].size) - shift // PARTS, 0, None)]
    rng = np.random.default_rng(seed)
    for name in ("alpha", "q"):
        rows[name] = rows[name] + nsr * rows[name].std() * rng.standard_normal(rows[name].size)
    return mf.Record(
        {name: rows[name] for name in ("alpha", "q")}, {"de": rows["de"]}, dt=dt, intersample=word
    )


def cured(rec, text):
    """The record after what the warning says to try first."""
    words = re.search(r"First try (rec\.assign\(.*?\)): BIC", text)[1]
    return eval(words, {"rec": rec, "np": np, "scipy": scipy})  # the package's own words


def followed(rec, text, model):
    """The fit that the warning says to try first, of a changed record or with a lag, and its warning."""
    if lag := re.search(r"First try a lag of the sensor of alpha .*?, (mf\.StateSpace\(.*?\)): BIC", text):
        return warned(rec, eval(lag[1], {"mf": mf}))  # the package's own words
    return warned(cured(rec, text), model)


@pytest.mark.parametrize("model", [SHORT, WRITTEN])
@pytest.mark.parametrize(
    ("channel", "late", "said"),
    [
        ("de", 1, "late"),
        ("alpha", 1, "late"),
        ("q", 4, "late"),
        ("q", -1, "early"),
        ("q", -0.5, "early"),
    ],
)
def test_a_channel_recorded_late_is_named_and_its_cure_works(model, channel, late, said):
    """At 2 % noise in every record; derivatives and shifts within four standard errors, one set in 1,000."""
    for seed in range(3):
        rec = flown(seed, **{channel: late})
        fit, text = warned(rec, model)
        size, error = (
            float(part)
            for part in re.search(rf"{channel} seems to be recorded (\S+) ± (\S+) s", text).groups()
        )
        assert f"{said} beside the other channels" in text
        assert error < 0.1 * rec.dt
        assert abs(size - abs(late) * rec.dt) < 4 * error
        better, again = followed(rec, text, model)
        assert not again
        assert off(better) < min(4, off(fit))


@pytest.mark.parametrize("seed", range(3))
def test_a_surface_that_nobody_declared_stays_smooth_where_a_rate_is_late(seed):
    rec = flown(seed, nsr=0.05, q=1)
    rec = mf.Record(y={name: rec[name] for name in rec.outputs}, u={"de": rec["de"]}, dt=rec.dt)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        fit = mf.fit(rec, SHORT)
    assert fit.intersample == ("smooth",)  # half a sample of delay would make up for part of the rate's
    late = re.match(r"fit: q seems to be recorded ([\d.]+) ± ([\d.]+) s", str(said[0].message))
    assert abs(float(late[1]) - rec.dt) < 4 * float(late[2])


def test_derivatives_are_far_off_where_nothing_else_shows():
    """The residuals of a late vane at 10 % noise are those of noise, and yet the shift is seen."""
    rec = flown(2, nsr=0.1, dt=0.04, alpha=1)
    fit, text = warned(rec, SHORT)
    assert off(fit) > 7
    assert "alpha seems to be recorded" in text
    assert off(followed(rec, text, SHORT)[0]) < 3.5


def test_a_surface_late_by_many_samples_is_found():
    """Derivatives of another aircraft fit such records best, from which the search has to come back."""
    rec = flown(0, de=6)
    _, text = warned(rec, SHORT)
    assert "rec.assign(de=np.interp(rec.t + 0.12, rec.t, rec['de']))" in text
    assert off(warned(cured(rec, text), SHORT)[0]) < 3.5


def test_an_input_that_acts_late_has_a_delay():
    for seed in range(2):
        rec = flown(seed, nsr=0.05, de=-2)
        text = warned(rec, SHORT)[1]
        assert re.search(r"de seems to act 0\.0[34]\d* ± \S+ s .* later than the equations say", text)
        assert "First try a delay of de, delay='h'" in text
        late = SHORT._like(delay="h", params={"h": mf.Free(min=0, max=0.2)})
        fit, text = warned(rec, late)
        assert not text
        assert off(fit) < 4
        assert abs(fit["h"] - 0.04) < 4 * fit.bse["h"]


def test_a_held_input_declared_smooth_is_said_to_be_held_and_the_other_way_round():
    """Both are off by half a sample."""
    held = flown(0, word="zoh")
    assert not warned(held, SHORT)[1]
    assert (
        "First try intersample='zoh' in the record" in warned(held._like(intersample=("smooth",)), SHORT)[1]
    )
    smooth = flown(0)
    text = warned(smooth._like(intersample=("zoh",)), SHORT)[1]
    assert "First try intersample='smooth' in the record" in text


def test_a_held_input_one_sample_late_is_named():
    rec = flown(1, word="zoh", de=1)
    text = warned(rec, SHORT)[1]
    assert "de seems to be recorded" in text
    assert off(warned(cured(rec, text), SHORT)[0]) < 4


def test_where_the_record_tells_too_little_check_says_so():
    """A vane half a sample late at 5 %: seen at the level of one in a hundred, not beyond doubt."""
    found = []
    for seed in range(8):
        fit, text = warned(flown(seed, nsr=0.05, dt=0.04, alpha=0.5), SHORT)
        found.append("alpha seems to be recorded" in str(fit.check()) and not text)
    assert any(found)


@pytest.mark.parametrize("word", ["smooth", "zoh"])
def test_right_records_have_p_values_of_chance(word):
    """Thirty records: none warned of, and p-values below 0.01 in 3 at most: false alarm one in 4,000."""
    below = 0
    for seed in range(30):
        fit, text = warned(flown(seed, nsr=0.05, word=word), SHORT)
        assert not text
        below += likeliest_shift(fit).p_value < 0.01
    assert below <= 3


def test_the_error_of_a_shift_is_its_scatter():
    """Of 40 right records: the mean square of shift over error is 1 ± 0.22, here within three of these."""
    shifts = [likeliest_shift(mf.fit(flown(seed, nsr=0.05), SHORT), "de") for seed in range(40)]
    ratio = np.mean([(shift.late / shift.error) ** 2 for shift in shifts])
    assert 0.33 < ratio < 1.67


def test_what_is_not_tested_has_no_shift():
    """Nonlinear equations, transfer functions, masked samples and noise inside the system."""
    rec = flown(0)
    cubic = mf.Equation(
        ["alpha' = Za*alpha + q + Zd*de + c1", "q' = Ma*alpha + k*alpha**3 + Mq*q + Md*de + c2"],
        outputs=["alpha", "q"],
        inputs=["de"],
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        assert likeliest_shift(mf.fit(rec, cubic)) is None
        assert likeliest_shift(mf.fit(rec.weigh(mask=rec.t != 8.0), SHORT)) is None
        assert likeliest_shift(mf.fit(rec, SHORT, noise="process")) is None
        one = mf.TransferFunction(poles=2, zeros=1)
        assert likeliest_shift(mf.fit(rec.select(outputs=["q"]), one)) is None
