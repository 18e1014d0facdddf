"""Free motions whose period changes with the amplitude: what linear fits say, and right ones do not."""

import re
import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

POLES = mf.TransferFunction(poles=2)
LINEAR = mf.Equation("th'' + c*th' + k*th = 0", outputs="th")
SINE = mf.Equation("th'' + c*th' + k*sin(th) = 0", outputs="th")


def pendulum(degrees: float, seed: int, unit: str = "rad", off: float = 0.0) -> mf.Record:
    """A pendulum of 0.6 m that is let go, with noise of 0.3 degrees."""
    t = np.arange(0, 15, 0.02)
    motion = solve_ivp(
        lambda _, x: [x[1], -0.15 * x[1] - 16.35 * np.sin(x[0])],
        (0, 15), [np.radians(degrees), 0], t_eval=t, rtol=1e-9, atol=1e-10,
    )  # fmt: skip
    y = off + motion.y[0] + 0.005 * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(np.degrees(y) if unit == "deg" else y, dt=0.02, outputs="th", units={"th": unit})


def warned(rec: mf.Record, model: mf.TransferFunction | mf.Equation) -> str:
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        mf.fit(rec, model)
    return "\n".join(str(one.message) for one in found)


@pytest.mark.parametrize("degrees", [20, 45, 60, 75])
def test_poles_of_a_pendulum_name_its_sine(degrees):
    for seed in range(3):
        assert "First try mf.Equation(\"th'' + a1*th' + a2*sin(th) = 0\"" in warned(
            pendulum(degrees, seed), POLES
        )


def test_a_linear_equation_of_a_pendulum_names_its_sine():
    for degrees in (20, 60):
        assert "mf.Equation(\"th'' + c*th' + k*sin(th) = 0\"" in warned(pendulum(degrees, 0), LINEAR)


def test_in_degrees_a_cube_is_named():
    found = warned(pendulum(30, 0, "deg"), POLES)
    assert "a cube, mf.Equation(\"th'' + a1*th' + a2*th + cube*th**3 = 0\"" in found


def test_at_15_degrees_most_fits_warn():
    said = ["sin(th)" in warned(pendulum(15, seed), POLES) for seed in range(5)]
    assert sum(said) >= 3


def test_right_equations_do_not_warn():
    for degrees in (5, 20, 60, 75):
        assert warned(pendulum(degrees, 0), SINE) == ""
    for seed in range(5):
        assert warned(pendulum(5, seed), POLES) == ""


def test_linear_decays_in_coloured_noise_are_not_bent():
    t = np.arange(400) / 400
    for seed in range(10):
        rng = np.random.default_rng(seed)
        noise = np.cumsum(rng.standard_normal(400))
        y = np.exp(-0.35 * t) * np.cos(116 * t) + 0.1 * (noise - noise.mean()) / noise.std()
        assert "at these amplitudes" not in warned(mf.Record(y, dt=0.01, outputs="y"), POLES)


def test_another_mode_is_no_cube():
    t = np.arange(1200) / 100
    noise = 0.003 * np.random.default_rng(0).standard_normal(t.size)
    y = np.exp(-0.2 * t) * np.cos(6 * t) + 0.5 * np.exp(-0.3 * t) * np.cos(8 * t + 1) + noise
    assert "at these amplitudes" not in warned(mf.Record(y, dt=0.01, outputs="y"), POLES)


@pytest.mark.parametrize("off", [0.05, -0.08])
def test_an_offset_is_the_one_next_to_zero_and_has_a_name_of_its_own(off):
    rec = pendulum(60, 0, off=off)
    text = warned(rec, SINE)
    found = re.search(r"Write \(th - c0\) .* params=\{\"c0\": mf.Free\(0\)\}: c0 = (\S+),", text)
    assert found is not None, text
    assert float(found[1]) == pytest.approx(off, abs=0.005)
    cured = mf.Equation("th'' + c*th' + k*sin(th - c0) = 0", outputs="th", params={"c0": mf.Free(0)})
    assert mf.fit(rec, cured)["c0"] == pytest.approx(off, abs=0.005)
