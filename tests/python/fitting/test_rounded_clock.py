"""A delay of a record whose clock was only rounded: refused with the step to give."""

import modfun as mf
import numpy as np
import pytest

LATE = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(min=0, max=30))


def record(step, decimals):
    """300 steps of a held second-order system behind two steps, its clock rounded to these decimals."""
    system = mf.tf([1], [8 * step**2, 6 * step, 1], delay=2 * step)
    made = mf.simulate(
        system, input=f"sin(t**2/{1600 * step**2})", duration=300 * step, intervals=300, seed=1
    )
    return mf.Record(y=made.y, u=made.u, t=made.t.round(decimals), intersample="smooth")


@pytest.mark.parametrize(("step", "decimals", "named"), [(7.3, 0, "7.3"), (0.0333, 2, "0.0333")])
def test_a_rounded_clock_is_named_with_its_step(step, decimals, named):
    rec = record(step, decimals)
    assert rec.dt is None
    structure = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(min=0, max=4 * step))
    cure = rf"if its clock was only rounded, give dt={named} instead of the times"
    late = mf.Equation("y'' + a*y' + b*y = c*u(t-h)", params={"h": mf.Free(min=0, max=4 * step)})
    for call in (
        lambda: mf.fit(rec, structure),
        lambda: mf.fit([rec, rec], structure),
        lambda: mf.fit_many([rec, rec], structure),
        lambda: mf.fit(rec, late),
    ):
        with pytest.raises(mf.DataError, match=cure):
            call()
    assert f"give dt={named} instead" in str(rec.check())
    even = mf.fit(mf.Record(y=rec.y, u=rec.u, dt=float(named), intersample="smooth"), structure)
    assert even["delay"] == pytest.approx(2 * step, rel=0.02)


def test_other_uneven_times_are_not_taken_for_a_rounded_clock():
    rng, rec = np.random.default_rng(0), record(7.3, 0)
    t = np.cumsum(rng.uniform(1, 13, rec.t.size))
    uneven = mf.Record(y=rec.y, u=rec.u, t=t, intersample="smooth")
    with pytest.raises(mf.DataError, match=r"steps are uneven; make it even, rec\.resample"):
        mf.fit(uneven, LATE)
