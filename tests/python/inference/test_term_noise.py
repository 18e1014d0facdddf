"""`select_terms` where noise is not what the criterion counts on: of counts, and of computed channels."""

from __future__ import annotations

from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options
from modfun.results.computed_channels import computed, computed_channel
from scipy.integrate import solve_ivp
from scipy.signal import savgol_filter

EPIDEMIC = {"S'": {"S*I"}, "I'": {"I", "S*I"}}
DT = 0.02
MODEL = mf.Equation(["x' = v", "v' = -d*v + a*x - b*x**3 + c*F"], outputs=["x", "v"], inputs=["F"])


def counts(seed: int) -> mf.Record:
    """An epidemic among 5,000 persons, counted once a day."""
    rng = np.random.default_rng(seed)
    t = np.arange(90.0)
    y = solve_ivp(
        lambda t, x: [-8e-5 * x[0] * x[1], 8e-5 * x[0] * x[1] - 0.1 * x[1]], (0, 89), [4990, 10], t_eval=t,
        rtol=1e-9, atol=1e-9,
    ).y  # fmt: skip
    return mf.Record(y=rng.poisson(y).astype(float), t=t, outputs=["S", "I"])


@pytest.mark.statistics
def test_counts_bring_no_superfluous_terms() -> None:
    """Without weights, five of these are wrong."""
    right = 0
    for seed in (5, 10, 18, 27, 34, 0, 1, 2):
        found = mf.select_terms(counts(seed), "polynomials of S, I up to 2", progress=False)
        right += {left: set(terms) for left, terms in found.terms.items()} == EPIDEMIC
        assert "goes with the size" in found.summary()
        assert "were weighted by it" in found.summary()
        assert found.records[0].sigma is not None
    assert right >= 7


def oscillator(seed: int, noise: float = 0.02, count: int = 2000) -> tuple[Any, Any]:
    """A driven Duffing oscillator in two wells: its states without noise, and its held input."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-2, 2, count // 25 + 1), 25)[:count]
    x, n = np.array([0.4, 0.0]), 4
    rows = []

    def slope(x: Any, f: float) -> Any:
        return np.array([x[1], f - 0.2 * x[1] + x[0] - x[0] ** 3])

    for f in u:
        rows.append(x)
        for _ in range(n):
            h = DT / n
            a = slope(x, f)
            b = slope(x + h / 2 * a, f)
            c = slope(x + h / 2 * b, f)
            x = x + h / 6 * (a + 2 * b + 2 * c + slope(x + h * c, f))
    return np.array(rows).T, u


def record(x: Any, v: Any, u: Any) -> mf.Record:
    return mf.Record(y=[x, v], u=u, dt=DT, outputs=["x", "v"], inputs=["F"], intersample="zoh")


CHANNELS = {
    "differences": lambda x: (x, np.gradient(x, DT)),
    "backward differences": lambda x: (x, np.diff(x, prepend=2 * x[0] - x[1]) / DT),
    "rounded": lambda x: (np.round(x, 4), np.round(np.gradient(x, DT), 4)),
    "smoothed": lambda x: (x, savgol_filter(x, 25, 3, deriv=1, delta=DT)),
    "both smoothed": lambda x: (savgol_filter(x, 15, 3), savgol_filter(x, 15, 3, deriv=1, delta=DT)),
}


@pytest.mark.parametrize("kind", CHANNELS)
def test_a_computed_channel_is_named(kind: str) -> None:
    for seed in (1, 2):
        states, u = oscillator(seed)
        x, v = CHANNELS[kind](states[0] + 0.02 * np.random.default_rng(seed).standard_normal(u.size))
        fit = fit_quietly((record(x, v, u),), MODEL, Options.checked("fit", band=(0.0, 8.0)))
        found = computed(fit)
        assert found is not None
        assert (found.derivative, found.source) == ("v", "x")
        doubt = computed_channel(fit)
        assert doubt is not None
        assert "First leave v out" in doubt.text


@pytest.mark.parametrize("noise", [0.1, 0.02, 1e-3, 1e-6])
def test_a_measured_channel_is_not(noise: float) -> None:
    for seed in (1, 2, 3):
        states, u = oscillator(seed)
        own, both = np.random.default_rng(seed).standard_normal((2, *states.shape))
        for y in (states + noise * own, states + noise * both[0]):  # the second with the same noise in both
            fit = fit_quietly((record(*y, u),), MODEL, Options.checked("fit", band=(0.0, 8.0)))
            assert computed(fit) is None


def test_a_selection_with_a_computed_channel_says_so() -> None:
    states, u = oscillator(1)
    x = states[0] + 0.02 * np.random.default_rng(1).standard_normal(u.size)
    found = mf.select_terms(record(x, np.gradient(x, DT), u), "polynomials of x, v up to 3, F")
    assert "v seems to be computed from x" in found.notes[0]
    assert "target=\"x''\"" in found.notes[0]
    assert "at most 1 %" not in found.summary()
    assert "faster" not in found.summary()
    alone = mf.Record(y=x, u=u, dt=DT, outputs=["x"], inputs=["F"], intersample="zoh")
    cured = mf.select_terms(alone, "polynomials of x, x' up to 3, F", target="x''")
    assert set(cured.terms["x''"]) == {"x", "x'", "x**3", "F"}
    assert "computed" not in cured.summary()


def test_what_is_refused_names_the_way_that_works() -> None:
    with pytest.raises(mf.SpecError, match=r"mf.fit\(rec, found.equation, noise=\"log-normal\"\)"):
        mf.select_terms(counts(0), "S, I", noise="log-normal")
    with pytest.raises(mf.SpecError, match=r"target=\[\"S' - I\", \"I'\"\]"):
        mf.select_terms(counts(0), {"S' - I": "S", "I'": "I"})


def test_records_without_noise_end_the_search():
    """Costs are 1e12 times the penalties there, and exchanges that rounding makes better went in circles."""
    found = solve_ivp(
        lambda t, x: [x[1], 2 * (1 - x[0] ** 2) * x[1] - x[0]], (0, 20), [1.5, 0.3], dense_output=True,
        rtol=1e-10, atol=1e-10, method="DOP853",
    )  # fmt: skip
    y = found.sol(np.linspace(0, 20, 1001))
    rec = mf.Record(y=y, dt=0.02, outputs=["x", "v"])
    chosen = mf.select_terms(rec, "polynomials of x, v up to 3", progress=False)
    assert dict(chosen.terms) == {"x'": ("v",), "v'": ("x", "v", "x**2*v")}
    assert chosen.fit.params == pytest.approx([1, -1, 2, -2], abs=1e-3)


@pytest.mark.parametrize("seed", [0, 8])
def test_levels_of_records_without_noise_do_not_run_away(seed):
    """One level went to 1e15 and its equation to 0 = 0, with status "ok": c2 was 0 instead of -0.5."""
    found = solve_ivp(
        lambda t, x: [x[0] - 0.5 * x[0] * x[1], 0.4 * x[0] * x[1] - x[1]], (0, 20),
        np.random.default_rng(seed).uniform(1, 4, 2),
        dense_output=True, rtol=1e-10, atol=1e-12, method="DOP853",
    )  # fmt: skip
    rec = mf.Record(y=found.sol(np.linspace(0, 20, 401)), dt=0.05, outputs=["x", "z"])
    model = mf.Equation(["x' = c1*x + c2*x*z", "z' = c3*z + c4*x*z"], outputs=["x", "z"])
    for edge in (20.0, 31.0, 45.0):
        fit = fit_quietly((rec,), model, Options.checked("fit", band=(0, edge)))
        assert fit.params == pytest.approx([1, -0.5, -1, 0.4], abs=1e-5), edge
