"""Which parameters of several equations can be found: as many as transfer functions tell."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

pytest.importorskip("sympy")

TRUE = {"Yb": -0.25, "Yp": 0.02, "Yr": 0.01, "Yda": -0.01, "Ydr": 0.04, "Lb": -12.0, "Lp": -3.5, "Lr": 1.2,
        "Lda": 18.0, "Ldr": 2.0, "Nb": 5.0, "Np": -0.15, "Nr": -0.6, "Nda": -0.5, "Ndr": -4.0}  # fmt: skip
SHOWN = {"p": [0, 1, 0, 0], "r": [0, 0, 1, 0], "phi": [0, 0, 0, 1], "ay": ["60*Yb", "60*Yp", 0, 0]}


def lateral(sideforce: list[object], aileron: object, outputs: list[str], **words: object) -> mf.StateSpace:
    """Sideslip without a vane, rates of roll and yaw, and the bank angle."""
    return mf.StateSpace(
        [sideforce, ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, 0, 0]],
        [[aileron, "Ydr"], ["Lda", "Ldr"], ["Nda", "Ndr"], [0, 0]],
        [SHOWN[name] for name in outputs],
        [["60*Yda" if aileron and name == "ay" else 0, "60*Ydr" if name == "ay" else 0] for name in outputs],
        states=["beta", "p", "r", "phi"], inputs=["da", "dr"], outputs=outputs, **words,
    )  # fmt: skip


def told(model: mf.StateSpace) -> int:
    """Rank of the slopes of the transfer functions at a few frequencies."""
    names = model.param_names()
    theta = np.array([TRUE[name] for name in names])

    def gains(values: np.ndarray) -> np.ndarray:
        s = model.model(dict(zip(names, values, strict=True)))
        at = [0.3j + w for w in (0.5, 1.1, 2.3, 3.1, 5.0, 7.0)]
        found = np.ravel([s.C @ np.linalg.solve(x * np.eye(4) - s.A, s.B) + s.D for x in at])
        return np.r_[found.real, found.imag]

    steps = 1e-6 * np.diag(theta)
    slopes = np.array([(gains(theta + h) - gains(theta - h)) for h in steps]).T
    return int(np.linalg.matrix_rank(slopes / np.linalg.norm(slopes, axis=0), tol=1e-7))


@pytest.mark.parametrize(
    ("sideforce", "aileron", "outputs", "rank"),
    [
        (["Yb", 0, -1, 0.16], 0, ["p", "r", "phi"], 12),
        (["Yb", 0, -1, 0.16], "Yda", ["p", "r", "phi"], 13),
        (["Yb", "Yp", "Yr - 1", 0.16], 0, ["p", "r", "phi"], 13),  # of 14, and 14 were claimed
        (["Yb", "Yp", -1, 0.16], 0, ["p", "r", "phi", "ay"], 13),
        (["Yb", 0, -1, 0.16], 0, ["r", "phi"], 12),
    ],
)
def test_a_multiple_of_an_equation_may_be_added_to_another(
    sideforce: list[object], aileron: object, outputs: list[str], rank: int
) -> None:
    """Coefficients of one equation are then none that a record tells."""
    model = lateral(sideforce, aileron, outputs)
    found = model.identifiable()
    assert found.rank == rank == told(model)
    assert bool(found) == (rank == len(model.param_names()))


def test_poles_of_free_motions_are_found() -> None:
    """A common factor of an equation is no multiple that may be taken out."""
    assert mf.StateSpace([["a", 0], [0, "b"]], C=[[1, 0], [0, 1]]).identifiable()
    assert mf.StateSpace([["a", "c"], [0, "b"]], C=[[1, 0], [0, 1]]).identifiable()
    assert mf.Equation("y'' + (a + b)*y' + a*b*y = u' + a*u").identifiable()


def record(model: mf.StateSpace, seed: int) -> mf.Record:
    """Doublets of aileron and rudder, 25 s at 50 Hz, under 1 % noise."""
    t = np.arange(1251) / 50
    u = np.zeros((2, t.size))
    for channel, begin, long in ((0, 1, 0.6), (1, 6, 0.8), (0, 13, 1.0), (1, 17, 0.5)):
        u[channel] += 0.05 * ((t >= begin) & (t < begin + long))
        u[channel] -= 0.05 * ((t >= begin + long) & (t < begin + 2 * long))
    s = model.model({name: TRUE[name] for name in model.param_names()})
    y = dlsim((*cont2discrete((s.A, s.B, s.C, s.D), 0.02)[:4], 0.02), u.T)[1].T
    y += 0.01 * y.std(axis=1, keepdims=True) * np.random.default_rng(seed).standard_normal(y.shape)
    return mf.Record(y=y, u=u, dt=0.02, outputs=model.outputs, inputs=model.inputs, intersample="zoh")


@pytest.mark.parametrize("told", [False, True])
def test_a_fit_names_what_no_record_tells(told: bool) -> None:
    """It said that the samples cannot tell; from starts nearby it ended at Yr = 0, a bound of nobody."""
    names = lateral(["Yb", "Yp", "Yr - 1", 0.16], 0, ["p", "r", "phi"]).param_names()
    near = np.random.default_rng(100).uniform(0.85, 1.15, len(names))
    starts = {name: mf.Free(TRUE[name] * by) for name, by in zip(names, near, strict=True)} if told else {}
    model = lateral(["Yb", "Yp", "Yr - 1", 0.16], 0, ["p", "r", "phi"], params=starts)
    with pytest.warns(mf.ModfunWarning, match="whatever the record: Yb, Yp, Yr, Lp, Lr, Np, Nr and Ydr"):
        fit = mf.fit(record(model, 0), model)
    assert fit.status == "rank"


def test_a_lateral_motion_without_a_vane_settles() -> None:
    """With the acceleration all are found."""
    model = lateral(["Yb", "Yp", -1, 0.16], 0, ["p", "r", "phi", "ay"])
    fit = mf.fit(record(model, 1), model)
    assert fit.success
    assert np.all(np.abs(fit.params - [TRUE[name] for name in fit.param_names]) < 4 * fit.bse)
