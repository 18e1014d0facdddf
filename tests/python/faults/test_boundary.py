"""Public calls with spoilt arguments end in finite numbers or in a ModfunError: fuzz/python/boundary.py."""

import signal

import modfun as mf
import numpy as np
import pytest
from places import ROOT

REC = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t)", duration=10.0, intervals=64, nsr=0.1, seed=0)
TF2 = mf.TransferFunction(poles=2, zeros=0)
T = 0.1 * np.arange(65)


class Refusing:
    def __array__(self, *_):
        raise ValueError("no array of me")


def ode():
    return mf.Equation("y' + a*y = u").model({"a": 1.0})


def controller():
    return mf.timelag.DelaySystem(A={0: 1.0}, B={1.0: 1.0}).place([-1.0]).controller(0.1)


def study():
    words = {"duration": 10.0, "intervals": 64, "nsr": [0.1, 0.2], "estimators": ["ls"], "replicates": 2}
    return mf.MonteCarlo(system=mf.tf([5], [1, 3, 8]), input="sin(t)", **words).run(progress=False)


pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")


@pytest.fixture
def boundary(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # some texts are taken for the names of folders
    monkeypatch.syspath_prepend(str(ROOT / "fuzz" / "python"))
    import boundary

    before = signal.signal(signal.SIGALRM, boundary._alarm)  # else a case too long ends the process
    yield boundary
    signal.signal(signal.SIGALRM, before)


def test_a_case_that_does_not_end_is_a_defect(boundary, monkeypatch):
    def endless(size):
        while True:
            pass

    monkeypatch.setattr(boundary, "SECONDS", 0.2)
    call = boundary.Call("endless", endless, lambda: {"size": 1}, ("size",), 1.0)
    counts, defects = boundary.run([call], 1, seed=1)
    assert counts["endless"] == {"defect": 1}
    assert [text for _, text in defects.values()] == ["not done after 0.2 s"]


def test_a_few_thousand_spoilt_calls(boundary):
    counts, defects = boundary.run(list(boundary.calls()), 2000, seed=1)
    assert not defects, "\n".join(f"{where}: {case}: {text}" for where, (case, text) in defects.items())
    assert sum(count["result"] for count in counts.values()) > 100
    assert sum(count["SpecError"] for count in counts.values()) > 500


def test_records_of_hostile_numbers_end_in_a_status(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "fuzz" / "python"))
    import many

    ended, faults = many.run(8 * many.BATCH, seed=1)
    assert not faults, "\n".join(faults)
    assert ended["ok"] > 1000
    assert ended["rank"] > 1000


def test_an_estimate_beyond_floating_point_is_not_ok(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "fuzz" / "python"))
    import many

    data, structure, options = many.batch(np.random.default_rng([2, 155]), many.BATCH)
    found = mf.fit_many(data, structure, **options)
    assert many.wrong(found) is None
    assert set(found.status[[820, 1147]]) <= {"rank", "nonfinite"}


# What the driver found, in the words of who would meet it.
FOUND = {
    "a name too long for a file": (lambda: mf.columns("x" * 5000), "there is no file"),
    "more orders than anyone compares": (
        lambda: mf.select_order(REC, poles=range(1, 10**30)),
        "more than 100 numbers of poles",
    ),
    "an initial state beyond floats": (
        lambda: mf.fit(REC, TF2).predict(REC, initial_state=[10**400, 0]),
        'must be "zero" or 2 numbers',
    ),
    "parameters as a list": (lambda: mf.crlb(mf.tf([5], [1, 3, 8]), REC, nsr=0.1, params=[1, 2]), "params"),
    "a band of one array": (lambda: mf.fit(REC, TF2, band=np.array(8)), None),
    "complex frequencies": (lambda: mf.tf([1], [1, 1]).frequency_response(1j), "complex"),
    "complex coefficients": (lambda: mf.tf([1], [1, 1j]), "complex"),
    "a path number": (lambda: mf.fit(REC, TF2).path_model(7), "whole number from 0 to 0"),
    "outputs beyond memory": (lambda: TF2.model([1, 2, 3], outputs=10**9), "from 0 to 100"),
    "intervals beyond memory": (
        lambda: mf.simulate(mf.tf([1], [1, 1]), input="1", duration=1.0, intervals=10**9),
        "from 1 to 10000000",
    ),
    "threads beyond 64 bits": (lambda: mf.sinusoids(REC, 1, threads=10**30), "threads"),
    "no threads": (lambda: mf.sinusoids(REC, 1, threads=-1), "threads"),
    "an order beyond 64 bits": (lambda: REC.noise_level(10**30), "order"),
    "samples whose squares overflow": (lambda: mf.Record(y=REC.y * 1e300, dt=0.1), "another unit"),
    "pieces of no length": (lambda: REC.split(every=1e-300), "pieces need"),
    "a start that swallows the steps": (lambda: mf.Record(y=REC.y, dt=0.1, t0=1e30), "t0=1e\\+30"),
    "a function that fails": (lambda: REC.assign(y=lambda r: 1 / 0), "division"),
    "an integer beyond floats": (lambda: mf.tf([10**400], [1, 1]), "num"),
    "a leading coefficient next to nothing": (lambda: mf.tf([1], [1e-320, 1]), "overflow"),
    "gains without bound": (
        lambda: mf.FrequencyResponse(omega=[1.0], magnitude_db=[1e5], phase_deg=[0.0]),
        "finite gains",
    ),
    "pieces of float32 seconds": (lambda: REC.split(every=np.float32(1e-44)), "pieces need"),
    "a step in float32": (lambda: mf.signals.doublet("de", dt=np.float32(3e38), width=5.0), "whole number"),
    "slopes beyond floats": (
        lambda: mf.tf([1], [1, 1]).simulate(u=1e150 * np.sin(np.arange(9.0)), dt=1e-170),
        "slopes beyond floating point",
    ),
    "slopes beyond floats in an equation": (
        lambda: ode().simulate(u=1e150 * np.sin(np.arange(9.0)), dt=1e-170),
        "slopes beyond floating point",
    ),
    "poles beyond memory": (lambda: mf.select_order(REC, poles=10**30), "from 1 to 100"),
    "an array of no dimension": (lambda: mf.tf([1], [np.array(None), 1]), "den"),
    "times next to each other": (lambda: mf.Record(y=REC.y[0], t=1e-200 * np.arange(65)), "out of range"),
    "a seed beyond 64 bits": (
        lambda: mf.simulate(mf.tf([1], [1, 1]), input="1", duration=1.0, intervals=9, seed=2**64),
        "seed",
    ),
    "a local polynomial without end": (lambda: mf.frf(REC, degree=10**9), "degree"),
    "instants in words": (lambda: ode().simulate(u="t", t=["a", "b"]), "t="),
    "a state in words": (
        lambda: ode().simulate(u="t", dt=0.1, intervals=9, initial_state="rest"),
        "initial_state=",
    ),
    "intervals of equations beyond memory": (
        lambda: ode().simulate(u="t", dt=0.1, intervals=10**30),
        "from 0 to 10000000",
    ),
    "a start that names more": (
        lambda: mf.rivals.output_error(TF2, start={"a1": 1, "a2": 1, "b0": 1, "b9": 1})(REC),
        "names b9",
    ),
    "a start in words": (
        lambda: mf.rivals.output_error(TF2, start={"a1": "x", "a2": 1, "b0": 1})(REC),
        "start",
    ),
    "a matrix in words": (lambda: mf.reduce(([["a"]], [[1]], [[1]]), 1), "A="),
    "weights that are nan": (
        lambda: mf.reduce(mf.tf([1], [1, 1]).frequency_response([1.0, 2.0]), 1, weight=[np.nan, 1.0]),
        "finite",
    ),
    "a sample of another system": (lambda: controller().step([1.0, 2.0]), "one per state"),
    "a past of another system": (lambda: controller().reset(u=[np.nan]), "finite samples"),
    "a step beyond floats": (
        lambda: mf.tf([1], [1, 1]).simulate(u=np.arange(9.0), dt=np.float64(1e308)),
        "out of range",
    ),
    "a masked entry": (lambda: mf.StateSpace([[np.ma.masked, 1], ["a", "b"]]), "give a number"),
    "a column that is none": (lambda: mf.read({"t": T, "y": Refusing()}, outputs="y"), "'y' cannot be read"),
    "a state that refuses": (lambda: mf.fit(REC, TF2).predict(REC, initial_state=Refusing()), "2 numbers"),
    "pulses that refuse": (lambda: mf.signals.multistep("u", [Refusing()], dt=0.1, unit=1.0), "widths"),
    "no weights": (lambda: mf.Estimator(TF2, output_weights=[]), "output_weights"),
    "a matrix without rows": (lambda: mf.timelag.equation({0: "a"}, {0: []}), "without rows"),
    "names in a square": (lambda: TF2.param_names(memoryview(np.zeros((2, 2)))), "inputs=<memory"),
    "a system that is a number": (
        lambda: mf.MonteCarlo(system=np.array(5), input="t", duration=1.0, intervals=9, estimators=["ls"]),
        "system is a ndarray",
    ),
    "a step of tones beyond floats": (lambda: mf.sinusoids(np.cos(T), 1, dt=1e-200), "out of range"),
    "tones whose squares overflow": (
        lambda: mf.sinusoids(1e299 * np.cos(T), 1, dt=0.1),
        "whose square overflows",
    ),
    "a state whose squares overflow": (
        lambda: mf.fit(REC, TF2).predict(REC, initial_state=[1e200, 0]),
        "whose square overflows",
    ),
    "gains that are not there": (
        lambda: mf.tf([1], [1, 1]).frequency_response([1.0, 2.0]).take([7]),
        "there are 2 frequencies",
    ),
    "an array for a cell": (lambda: study().replicate(0, nsr=np.arange(3)), "nsr=array"),
}


@pytest.mark.parametrize("case", FOUND)
def test_what_was_found_stays_mended(case):
    call, words = FOUND[case]
    if words is None:
        assert call().success
        return
    with pytest.raises((mf.SpecError, mf.DataError), match=words):
        call()


def test_times_that_are_infinite_are_said_in_the_note():
    table = mf.columns({"t": np.where(T > 6, np.inf, T), "y": T})
    assert "does not increase" in table["note"][0]


def test_a_masked_cell_is_empty():
    assert mf.Table({"a": [1.0, np.ma.masked]})["a"].tolist() == [1.0, None]


def test_delay_equations_without_inputs_may_say_so():
    assert mf.timelag.equation({0: "a"}, {}).inputs == ()


def test_all_lines_are_as_many_as_there_are():
    few, many = (mf.sinusoids(np.cos(T), 1, dt=0.1, lines=lines) for lines in (33, 10**9))
    assert np.array_equal(few.params, many.params)


def test_what_raises_although_arguments_fit_stays_raw():
    from modfun.base.arguments import public

    @public
    def broken(size: int) -> int:
        return [1, 2][size]

    with pytest.raises(IndexError):
        broken(7)
    with pytest.raises(mf.SpecError, match="broken: size='7' is of type str; it takes int"):
        broken("7")
