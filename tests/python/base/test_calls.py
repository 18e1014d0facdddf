"""Calls that Python itself would refuse: slips of names and positions, with what was meant."""

import modfun as mf
import pytest
from modfun.base.arguments import public

TWO = mf.TransferFunction(poles=2, zeros=0)


def _record():
    return mf.Record(y=[0.0, 1.0] * 20, u=[1.0, 0.0, 2.0, 1.0] * 10, dt=0.1, intersample="zoh")


def _study(**slip):
    system = mf.tf([1], [1, 1])
    return mf.MonteCarlo(
        system=system, input="sin(t)", duration=5.0, intervals=99, nsr=0.1, estimators=["ml"], **slip
    )


SLIPS = {
    "without names": (lambda: mf.TransferFunction(2, 0), r"write TransferFunction\(poles=\.\.\., zeros"),
    "one too many": (lambda: mf.tf([1], [1, 1], 0.2), r"3 arguments .* write tf\(num, den, delay=\.\.\.\)"),
    "Ts": (lambda: mf.Record([0.0] * 20, Ts=0.1), "no option 'Ts'; give dt=..., the sampling interval"),
    "dt": (lambda: mf.simulate(mf.tf([1], [1, 1]), dt=0.1), "'dt'; give intervals=.*duration/dt"),
    "step without a name": (lambda: mf.Record([0.0] * 20, 0.1), "sampling interval by its name, dt="),
    "x0": (lambda: mf.tf([1], [1, 1]).simulate(u="t", dt=0.1, x0=[1.0]), "'x0'; give initial_state="),
    "twice": (lambda: mf.rivals.output_error(1, model=2), "output_error: model is given by its name, and is"),
    "nearest": (lambda: mf.read("x.csv", output="y"), "no option 'output'; did you mean 'outputs'"),
    "missing": (lambda: mf.MonteCarlo(system=mf.tf([1], [1, 1])), "estimators is missing"),
    "study": (lambda: _study(replicate=5), "no option 'replicate'; did you mean 'replicates'"),
    "study's run": (lambda: _study(thread=2), r"thread is no part of a study .* study\.run\(threads=2\)"),
    "runs": (lambda: _study(runs=5), r"no option 'runs'; give replicates=\.\.\., their number"),
    "orders": (lambda: mf.select_order(_record(), orders=[1, 2]), "'orders'; give poles=.*, their number"),
    "poles": (lambda: mf.select_order(_record(), pole=[1, 2]), "no option 'pole'; did you mean 'poles' or"),
    "many": (lambda: mf.fit_many([_record()], TWO, thread=1), "no option 'thread'; did you mean 'threads'"),
    "classical": (lambda: mf.fit(_record(), TWO, cov_type="classical"), "standard errors are 'nonrobust'$"),
    "white": (lambda: mf.fit(_record(), TWO, noise="white"), "white noise of the outputs is 'output', white"),
    "method": (lambda: mf.signals.chirp("u", band=(1, 2), dt=0.1, duration=1).plot(axes=0), "mean 'ax'"),
}


@pytest.mark.parametrize("case", SLIPS)
def test_slips_are_named(case):
    call, words = SLIPS[case]
    with pytest.raises((mf.SpecError, mf.DataError), match=words):
        call()


def test_a_slip_deeper_down_stays_raw():
    @public
    def outer(x):
        return dict.fromkeys(x, wrong=1)

    with pytest.raises(TypeError, match="keyword"):
        outer([1])
    with pytest.raises(mf.SpecError, match=r"outer: x is missing; give x="):
        outer()


@pytest.mark.parametrize(
    ("args", "given"), [(([3], [1, 1.2, 4]), {}), ((), {"num": [3], "den": [1, 1.2, 4]})]
)
@pytest.mark.parametrize("kind", [mf.TransferFunction, mf.LTI])
def test_classes_called_with_coefficients_name_what_makes_a_system(kind, args, given):
    with pytest.raises(mf.SpecError, match=r"\. .*system .* mf\.tf\(num, den\)"):
        kind(*args, **given)
    with pytest.raises(mf.SpecError) as misspelt:
        kind(zeroes=1)
    assert "mf.tf" not in str(misspelt.value)
