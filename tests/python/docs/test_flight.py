"""After the flight: the example of docs/flight.md finds the aircraft of its sample."""

import contextlib
import re
import sys
from dataclasses import replace
from pathlib import Path

import modfun as mf
import numpy as np
import pytest
from modfun.base.named import Named
from places import ROOT

pytest.importorskip("sympy")


@pytest.fixture(scope="module")
def example():
    sys.path.insert(0, str(ROOT / "examples"))
    try:
        import flight_test
    finally:
        sys.path.pop(0)
    return flight_test


@pytest.fixture(scope="module")
def found(example, tmp_path_factory):
    with contextlib.chdir(tmp_path_factory.mktemp("flown")):
        found = example.main([])
        assert list(Path().iterdir()) == [Path("run7.csv")]  # which the page's blocks read
    return found


def test_the_derivatives_are_those_of_the_aircraft(example, found):
    """Five derivatives within three standard errors: false alarm about one in 70, the seed is fixed."""
    derivatives, unseen, _ = found
    truth = np.array(list(example.TRUTH.values()))
    assert derivatives.param_names == ("Za", "Ma", "Mq", "Zde", "Mde")
    names = derivatives.param_names
    off = np.array([derivatives[name] - example.TRUTH[name] for name in names]) / derivatives.bse
    assert np.all(np.abs(off) < 3), off
    assert np.all(derivatives.bse < 0.01 * np.abs(truth).max())
    assert not derivatives.check()
    # White noise of .08 deg and .15 deg/s on about 1.3 deg and 2.8 deg/s rms: simulation leaves the noise.
    level = np.std(derivatives.errors(unseen), axis=1)
    np.testing.assert_allclose(level, np.deg2rad([0.08, 0.15]), rtol=0.15)


def test_the_lower_order_system_has_its_delay(example, found):
    """K, T, omega, zeta, tau within three standard errors; `derived` knows the delay by its name."""
    table = found[2].derived(**example.FORM)
    truth = example.lower_order_truth()
    assert table["name"].tolist() == list(truth)
    off = (table["value"] - np.array(list(truth.values()))) / table["bse"]
    assert np.all(np.abs(off) < 3), off
    assert np.all(table["bse"] / table["value"] < 0.02)


def test_augmentation_is_found(example):
    told = mf.collinearity(example.augmented(), example.short_period)
    assert told.condition > 30
    assert told.findings[0].startswith("Ma, Mq and Mde can hardly be told apart")


def test_a_table_for_the_report(found):
    fit = found[0]
    table = fit.table(0.9, units={"Ma": "1/s^2"})
    assert table.columns == ("parameter", "value", "unit", "se", "t", "5 %", "95 %")
    assert table["unit"].tolist() == ["", "1/s^2", "", "", ""]
    np.testing.assert_array_equal(np.column_stack([table["5 %"], table["95 %"]]), fit.conf_int(0.9))
    assert table.to_dict()["value"] == fit.params.tolist()
    assert fit.table() == fit.summary().parameters
    with pytest.raises(mf.SpecError, match="'Mw', which is not a parameter"):
        fit.table(units={"Mw": "1/s"})


def test_the_summary_shows_the_equations(found):
    assert "alpha' = Za*alpha + q + Zde*de; q' = Ma*alpha + Mq*q + Mde*de" in str(found[0].summary())


def test_units_follow_what_is_converted():
    rec = mf.Record(y=np.arange(9.0), u=np.ones(9), dt=0.1, outputs="q", inputs="de", units={"q": "deg/s"})
    turned = rec.assign(
        q=lambda r: np.deg2rad(r["q"]), extra=rec["q"], units={"q": "rad/s", "extra": "deg/s"}
    )
    assert turned.units == {"q": "rad/s", "extra": "deg/s"}
    assert rec.assign(units={"de": "deg"}).units == {"q": "deg/s", "de": "deg"}
    assert rec.assign(q=rec["q"]).units == {}
    with pytest.raises(mf.SpecError, match="'Q', which is not a channel; did you mean 'q'"):
        rec.assign(units={"Q": "rad/s"})


def test_derived_reads_names_with_channels():
    rec = mf.simulate(
        mf.tf([[[1, 2], [3]], [[0.5], [-1, 0.7]]], [1, 1.2, 4]),
        input=["sin(t**2/6)", "cos((20-t)**2/5)"],
        duration=20.0,
        intervals=400,
        outputs=["alpha", "q"],
        inputs=["de", "da"],
    )
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=[[1, 0], [0, 1]], denominator="common"))
    table = fit.derived(text="b1[alpha,de]/(2*b0[q,da]) + a1", own=lambda p: p["b1[alpha,de]"])
    wanted = fit["b1[alpha,de]"] / (2 * fit["b0[q,da]"]) + fit["a1"]
    assert table["value"].tolist() == [wanted, fit["b1[alpha,de]"]]
    with pytest.raises(mf.SpecError, match="reading the expression"):
        fit.derived(wrong="b7[q,da]")


def test_a_counter_marks_its_manoeuvres():
    """Numbers 1, 2, 3 in the event channel, two of them without a pause between."""
    count = np.zeros(90)
    count[10:30], count[40:60], count[60:80] = 1, 2, 3
    rec = mf.Record(y=np.arange(90.0), dt=0.5, keep={"run": count})
    assert [(part.t[0], len(part.t)) for part in rec.split(on="run")] == [(5.0, 20), (20.0, 20), (30.0, 20)]
    # A button that is pressed for a moment: the message says when.
    pressed = np.isin(np.arange(90), [10, 50]).astype(float)
    with pytest.raises(mf.DataError, match=r"on 2 times, never for 8 samples or more \(at t = 5, 25 s\)"):
        rec.assign(run=pressed).split(on="run")
    # Samples of something, whole numbers by chance, above the middle of their range.
    assert len(rec.split(on="y")) == 1


def test_the_same_from_the_shell(example, found, tmp_path, capsys):
    """--on, --only and --missing give the records that Python has."""
    pytest.importorskip("typer")
    from modfun.commands.main import main

    path = tmp_path / "run7.csv"
    example.write_sample(path)
    words = [str(path), "--time", "TIME [s]"]
    channels = ["--output", "Q (deg/s)", "--input", "STICK (in)"]
    structure = ["--poles", "2", "--zeros", "1", "--delay", "0:0.4"]
    saved = tmp_path / "low.json"
    assert (
        main(["fit", *words, *channels, *structure, "--on", "EVENT", "--only", "0,1,2", "--json", str(saved)])
        == 0
    )
    low = mf.load(saved)
    assert abs(low["delay"] - example.DELAY) < 3 * low.bse[-1]
    angles = ["--output", "alpha=ALPHA (deg)", "--output", "q=Q (deg/s)", "--input", "de=DELE (deg)"]
    radians = [word for one in ("alpha=rad", "q=rad/s", "de=rad") for word in ("--convert", one)]
    model = ["--states", "alpha,q", "--A", "Za 1; Ma Mq", "--B", "Zde; Mde", "--intersample", "smooth"]
    only = ["--on", "EVENT", "--only", "0,1,2", "--missing", "mask"]
    file = tmp_path / "derivatives.json"
    assert main(["fit", *words, *angles, *radians, *model, *only, "--json", str(file)]) == 0
    np.testing.assert_allclose(mf.load(file).params, found[0].params, rtol=1e-9)
    capsys.readouterr()
    assert main(["compare", str(saved), *words, "--on", "EVENT", "--only", "3"]) == 0
    assert "25.6" in capsys.readouterr().out
    assert main(["compare", str(saved), *words, "--on", "EVENT"]) == 2
    assert "say with --only which one" in capsys.readouterr().err
    assert main(["check", *words, "--output", "ALPHA (deg)", "--on", "EVENT", "--missing", "mask"]) == 0
    assert capsys.readouterr().out.count("Record of 13 s") == 4
    assert main(["fit", *words, *channels, "--on", "EVENT", "--only", "4"]) == 2
    assert "numbers from 0 to 3" in capsys.readouterr().err


@pytest.fixture(scope="module")
def runs(example, tmp_path_factory):
    path = tmp_path_factory.mktemp("flight") / "run7.csv"
    example.write_sample(path)
    return example.read_flight(path)


def sticks(runs):
    return [run.select(outputs=["q"], inputs=["stick"]) for run in runs[:3]]


def spoiled(run, **channels):
    return run.assign(**{name: given(run[name].copy()) for name, given in channels.items()})


def spike(values):
    values[300] = 1.0
    return values


def held(values):
    return np.repeat(values[::10], 10)[: values.size]


def gap(run):
    good = np.ones(run.t.size, bool)
    good[200:300] = False
    return run.weigh(mask=good)


TWO = {"poles": 2, "zeros": 1}
# What is done wrong, and what modfun says of it.
TROUBLES = {
    "saturated": (
        lambda runs, m: spoiled(runs[0], de=lambda de: np.clip(de, -0.06, -0.015)).check(),
        "may be clipped: # samples sit exactly at its largest value",
    ),
    "held": (
        lambda runs, m: mf.Record(
            y=runs[0].y, u=held(runs[0]["de"]), dt=runs[0].dt, intersample="smooth"
        ).check(),
        "is declared smooth but holds its value",
    ),
    "spike": (lambda runs, m: spoiled(runs[0], alpha=spike).check(), "has # outlying sample"),
    "dropout": (lambda runs, m: mf.fit(gap(runs[0]), m), "a gap hides # of # samples"),
    "late": (
        lambda runs, m: mf.fit(sticks(runs), mf.TransferFunction(**TWO, delay=0.05)).check(),
        "The residuals of q follow stick",
    ),
    "bound": (
        lambda runs, m: mf.fit(
            sticks(runs), mf.TransferFunction(**TWO, delay=mf.Free(min=0, max=0.1))
        ).check(),
        "delay ended on a bound",
    ),
    "too simple": (
        lambda runs, m: mf.fit(sticks(runs), mf.TransferFunction(**TWO, delay=0.05)).check(),
        "The residuals are # times the noise level of the unused high band",
    ),
    "gust": (
        lambda runs, m: mf.fit(sticks(runs), mf.TransferFunction(**TWO, delay=0.05)).check(),
        "Neighbouring residual lines are correlated",
    ),
    "too many": (
        lambda runs, m: mf.fit(sticks(runs), mf.TransferFunction(poles=4, zeros=3, delay=0.12)).check(),
        "The estimate is unstable",
    ),
    "units": (
        lambda runs, m: mf.fit([spoiled(run, q=np.rad2deg) for run in runs[:3]], m).check(),
        "seems to be in degrees and not in radians",
    ),
    "signs": (
        lambda runs, m: mf.fit([spoiled(run, q=np.negative) for run in runs[:3]], m).check(),
        "of the opposite sign",
    ),
    "unsettled": (
        lambda runs, m: mf.fit([spoiled(run, q=np.rad2deg) for run in runs[:3]], m).message,
        "Not settled after # iterations",
    ),
    "channels": (lambda runs, m: mf.fit(runs[0].select(outputs=["q"]), m), "the record has outputs"),
}


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
@pytest.mark.parametrize("trouble", TROUBLES)
def test_modfun_says_what_the_page_says(example, runs, trouble):
    act, words = TROUBLES[trouble]
    try:
        said = str(act(runs, example.short_period))
    except mf.ModfunError as error:
        said = str(error)
    number = re.compile(r"\b\d+(?:\.\d+)?")
    assert words in number.sub("#", said)
    page = (ROOT / "docs" / "flight.md").read_text(encoding="utf-8")
    assert f"`{words}" in number.sub("#", page)


def test_a_one_tells_units_and_signs(runs):
    """The 1 of alpha' = Za alpha + q + ... as a parameter: 1, pi/180, -1."""
    doubt = mf.StateSpace(
        [["Za", "k"], ["Ma", "Mq"]], [["Zde"], ["Mde"]], states=["alpha", "q"], inputs=["de"]
    )
    for change, k in ((lambda q: q, 1.0), (np.rad2deg, np.pi / 180), (np.negative, -1.0)):
        fit = mf.fit([spoiled(run, q=change) for run in runs[:3]], doubt)
        assert abs(fit["k"] - k) < 3 * fit.bse[fit.param_names.index("k")]


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
def test_a_response_that_overflows_is_refused_in_words(example, runs):
    fit = mf.fit(runs[0], example.short_period)
    values = np.where(np.array(fit.param_names) == "Ma", 1e4, fit.params)  # a pole at 100 rad/s
    diverging = replace(fit, params=Named(values, fit.param_names))
    with pytest.raises(mf.DataError, match="overflows within 13 s"):
        diverging.score(0)


def test_accelerometers_take_the_place_of_a_vane(example):
    """q and az alone: all five derivatives within three standard errors (false alarm one in 70)."""
    model = mf.StateSpace(
        [["Za", 1], ["Ma", "Mq"]],
        [["Zde"], ["Mde"]],
        C=[[0, 1], ["189.5*Za", 0]],
        D=[[0], ["189.5*Zde"]],
        states=["alpha", "q"],
        outputs=["q", "az"],
        inputs=["de"],
    )
    t = 0.02 * np.arange(651)
    de = np.convolve(0.05 * np.sign(np.sin(1.7 * t)) * (t < 6), np.hanning(19)[1:-1] / 9.0, "same")
    y = np.asarray(model.model(example.TRUTH).simulate(u=[de], dt=0.02))
    y = y + 0.02 * y.std(axis=1)[:, None] * np.random.default_rng(0).standard_normal(y.shape)
    fit = mf.fit(mf.Record(y=y, u=de, dt=0.02, outputs=["q", "az"], inputs=["de"]), model)
    off = [(fit[name] - value) for name, value in example.TRUTH.items()]
    errors = dict(zip(fit.param_names, fit.bse, strict=True))
    assert np.all(np.abs(off) < 3 * np.array([errors[name] for name in example.TRUTH]))
