"""Records whose undeclared inputs look unlike between samples: in one fit, and in many at once."""

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.fitting.undeclared import _kinds

PLANT, MODEL = mf.tf([2, 20], [1, 2, 20]), mf.TransferFunction(poles=2, zeros=1)
TRUTH, DT, N = np.array([2.0, 20.0, 2.0, 20.0]), 0.02, 501


def record(kind: str, seed: int, nsr: float, intersample: str = "auto") -> mf.Record:
    """A binary (or in straight lines) or white sequence that is held, or a chirp that is smooth or held."""
    rng, t = np.random.default_rng(seed), DT * np.arange(N)
    u = {
        "binary": lambda: np.repeat(np.sign(rng.standard_normal(N // 25 + 2)), 25)[:N],
        "line": lambda: np.repeat(np.sign(rng.standard_normal(N // 25 + 2)), 25)[:N],
        "white": lambda: rng.standard_normal(N),
    }.get(kind, lambda: np.sin(t**2 / 3))()
    form = {"chirp": "smooth", "line": "foh"}.get(kind, "zoh")
    y = PLANT.simulate(u=u, dt=DT, intersample=form).ravel()
    y = y + nsr * y.std() * rng.standard_normal(N)
    return mf.Record(y=y, u=u, dt=DT, intersample=intersample)


def fitted(*kinds: str, seed: int, nsr: float, model=MODEL) -> tuple[mf.Fit, str]:
    """One fit of such records, and what it warned of."""
    records = [record(kind, 100 * seed + k, nsr) for k, kind in enumerate(kinds)]
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        fit = mf.fit(records, model)
    return fit, "".join(str(one.message) for one in said)


@pytest.mark.parametrize("kinds", [("white", "binary"), ("binary", "white"), ("binary", "held chirp")])
def test_one_form_in_truth_is_found_where_records_look_unlike(kinds):
    """White sequences look rough, chirps smooth, and half of such fits were read as smooth, -15 errors off.

    The mean square of 48 scores, four in each of twelve fits, is above 1.7 once in 500 if independent.
    """
    scores = []
    for seed in range(12):
        fit, _ = fitted(*kinds, seed=seed, nsr=0.02)
        assert fit.intersample == ("zoh",)
        asked = next(k for k, kind in enumerate(kinds) if kind != "binary")
        assert "zoh (by the fit)" in repr(fit.records[asked])
        scores.append((fit.params - TRUTH) / fit.bse)
    assert np.mean(np.square(scores)) < 1.7


@pytest.mark.parametrize("kinds", [("binary", "chirp"), ("white", "chirp"), ("line", "chirp")])
def test_records_that_differ_are_each_read_as_they_were(kinds):
    """One form for both put estimates 2.5 to 15 errors off.

    The mean square of 32 scores, four in each of eight fits, is above 1.9 once in 600 if independent.
    """
    held, scores = "foh" if kinds[0] == "line" else "zoh", []
    for seed in range(8):
        fit, _ = fitted(*kinds, seed=seed, nsr=0.02)
        assert [rec.intersample for rec in fit.records] == [(held,), ("smooth",)]
        scores.append((fit.params - TRUTH) / fit.bse)
    assert np.mean(np.square(scores)) < 1.9


def test_what_one_record_declares_holds_for_the_others():
    rec, told = record("chirp", 0, 0.02), record("chirp", 1, 0.02, "zoh")
    assert [own.intersample for own in mf.fit([rec, told], MODEL).records] == [("zoh",)] * 2


def test_equations_of_records_that_look_unlike():
    equation = mf.Equation("y'' + a*y' + b*y = c*u' + d*u")
    fit, _ = fitted("white", "binary", seed=0, nsr=0.02, model=equation)
    assert fit.intersample == ("zoh",)


def test_many_records_are_read_as_each_looks():
    """The first four decided for all: the gain of the others was 13 to 27 standard errors off.

    The mean square of 32 scores, four in each of eight fits, is above 1.9 once in 600 if independent.
    """
    records = [record("binary", seed, 0.02) for seed in range(4)]
    records += [record("chirp", 100 + seed, 0.02) for seed in range(4)]
    for order in (range(8), range(7, -1, -1), (0, 4, 1, 5, 2, 6, 3, 7)):
        many = mf.fit_many([records[k] for k in order], MODEL, progress=False)
        assert np.mean(np.square((many.params - TRUTH) / many.bse)) < 1.9
        assert len(many.notes) == 1
        assert "zoh in 4" in many.notes[0]
        assert "smooth in 4" in many.notes[0]
    told = [rec._like(_seen={}) for rec in records]
    assert np.array_equal(mf.fit_many(told, MODEL, progress=False).params, mf.fit_many(records, MODEL).params)


def test_an_input_at_rest_is_read_as_in_the_other_records():
    """Two inputs of which one moves in each record; a motion of the other is another kind."""
    records = []
    for k in range(4):
        rec = record("binary", k, 0.02)
        rows = [rec.u[0], 0 * rec.u[0]] if k % 2 else [0 * rec.u[0], rec.u[0]]
        records.append(mf.Record(y=rec.y, u=np.array(rows), dt=DT, inputs=["a", "b"]))
    assert {rec.intersample for rec in records} == {("zoh", "smooth"), ("smooth", "zoh")}
    records.append(mf.Record(y=rec.y, u=np.array([rec.u[0], np.sin(rec.t)]), dt=DT, inputs=["a", "b"]))
    assert _kinds(records) == [[0, 1, 2, 3], [4]]


def test_a_record_that_is_seen_to_be_held_is_scored_so():
    """The score of such a record by a fit of chirps was 27 dB, and is 60 dB where zoh is declared."""
    fit = mf.fit(record("chirp", 0, 1e-3), MODEL)
    assert fit.intersample == ("smooth",)
    rec, told = record("binary", 1, 1e-3), record("binary", 1, 1e-3, "zoh")
    assert np.array_equal(fit.predict(rec).y, fit.predict(told).y)
    wrong = record("binary", 1, 1e-3, "smooth")
    scores = [fit.score(one)["signal_to_error"].item() for one in (rec, told, wrong)]
    assert scores[0] == scores[1] > scores[2] + 20


def in_forms(plant: mf.LTI, seed: int, nsr: float, delay: float = 0.0) -> list[mf.Record]:
    """A sequence held by a computer and a sweep that was measured, declared so, with outputs from rest."""
    rng, t = np.random.default_rng(seed), DT * np.arange(N)
    steps = np.repeat(rng.standard_normal(N // 20 + 1), 20)[:N]
    records = []
    for u, kind in ((steps, "zoh"), (np.sin(t**2 / 3) * np.sin(np.pi * t / t[-1]) ** 2, "smooth")):
        late = np.concatenate([np.zeros(round(delay / DT)), u])[:N]
        y = np.atleast_2d(plant.simulate(u=late, dt=DT, intersample=kind))
        y = y + nsr * y.std(axis=1, keepdims=True) * rng.standard_normal(y.shape)
        records.append(mf.Record(y=y, u=u, dt=DT, intersample=kind))
    return records


TWO = mf.ss([[0, 1], [-20, -2]], [[0], [1]], [[20, 2], [0, 1]], [[0], [0]])
AT_ONCE = mf.tf([0.5, 2, 20], [1, 2, 20])
EQUATION = mf.Equation("y'' + a*y' + b*y = c*u' + d*u")
SPACE = mf.StateSpace([[0, 1], [-20, "-a"]], [[0], ["c"]], C=[[1, 0]], inputs=["u"], outputs=["y"])


@pytest.mark.parametrize(
    ("plant", "model", "truth", "options", "least"),
    [
        (PLANT, MODEL, [2, 20, 2, 20], {}, 1e-6),
        (PLANT, MODEL, [2, 20, 2, 20], {"harmonics": 30, "method": "awls"}, 1e-6),
        (PLANT, MODEL, [2, 20, 2, 20], {"harmonics": 30, "initial_state": "zero"}, 1e-6),
        (PLANT, MODEL, [2, 20, 2, 20], {"harmonics": 30, "initial_state": "rest"}, 1e-6),
        (AT_ONCE, mf.TransferFunction(poles=2, zeros=2), [2, 20, 0.5, 2, 20], {}, 1e-6),
        (PLANT, EQUATION, [2, 20, 2, 20], {}, 1e-6),
        (PLANT, EQUATION, [2, 20, 2, 20], {"harmonics": 30}, 1e-6),
        (mf.tf([3], [1, 2, 20]), SPACE, [2, 3], {}, 1e-6),
    ],
)  # fmt: skip
def test_each_record_is_integrated_in_its_own_form(plant, model, truth, options, least):
    for records in (in_forms(plant, 0, 0.0), in_forms(plant, 0, 0.0)[::-1]):
        fit = mf.fit(records, model, **options)
        assert fit.intersample == ("mixed",)
        assert [rec.intersample for rec in fit.records] == [rec.intersample for rec in records]
        assert np.allclose(fit.params, truth, rtol=least, atol=0)


def test_free_delays_of_records_that_differ_in_form():
    late = mf.TransferFunction(poles=2, zeros=1, delay=mf.Free(min=0.0, max=0.3))
    fit = mf.fit(in_forms(PLANT, 0, 0.0, delay=0.1), late, harmonics=30)
    assert np.allclose(fit.params, [2, 20, 2, 20, 0.1], rtol=1e-5, atol=0)


def test_several_outputs_of_records_that_differ_in_form():
    model = mf.TransferFunction(poles=2, zeros=[[1], [1]], denominator="common")
    fit = mf.fit(in_forms(TWO, 0, 1e-4), model)
    assert np.all(np.abs(fit.params - [2, 20, 2, 20, 1, 0]) < 4 * fit.bse)


@pytest.mark.parametrize(
    ("model", "truth"),
    [(MODEL, [2, 20, 2, 20]), (EQUATION, [2, 20, 2, 20])],
    ids=["transfer function", "equation"],
)
def test_errors_of_records_that_differ_in_form(model, truth):
    """Scores of 60 lists for four parameters: their rms is outside .87 to 1.14 once in 500 if independent."""
    scores = []
    for seed in range(60):
        fit = mf.fit(in_forms(PLANT, seed, 0.02 + 0.03 * (seed % 2)), model)
        scores.append((fit.params - truth) / fit.bse)
    assert 0.87 < np.sqrt(np.mean(np.square(scores))) < 1.14
