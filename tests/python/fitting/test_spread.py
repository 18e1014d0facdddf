"""Noise whose level is given for each sample is taken out of powers and products sample by sample."""

import modfun as mf
import numpy as np
import pytest
import sympy
from modfun.equations.layout import layout_of, with_spread
from modfun.fitting.spread import spread_of
from modfun.models.options import Options

LOGISTIC = mf.Equation("N' = r*N*(1 - N/K)", outputs=["N"])
TRUTH = {"r": 0.8, "K": 100.0}
T = np.linspace(0, 14, 281)
GROWTH = 100 / (1 + 19 * np.exp(-0.8 * T))


def scores(sd, masked: float = 0.0, seeds: int = 6, **given) -> np.ndarray:
    """Errors of r and K in standard errors."""
    found = []
    for seed in range(seeds):
        g = np.random.default_rng(seed)
        y = GROWTH + sd * g.standard_normal(T.size)
        wrong = g.random(T.size) < masked
        rec = mf.Record(y=y + 300 * wrong, dt=T[1], outputs=["N"], mask=~wrong if masked else None)
        fit = mf.fit(rec.weigh(sigma=sd / sd.mean()), LOGISTIC, **given)
        found.append([(fit.params[name] - value) / fit.bse[name] for name, value in TRUTH.items()])
    return np.array(found)


@pytest.mark.parametrize(
    "sd",
    [0.1 * GROWTH, 0.2 * GROWTH, np.where(T > 5, 10.0, 2.0)],
    ids=["10 %", "20 %", "later"],
)
def test_estimates_are_within_their_errors(sd):
    found = scores(sd)  # they were 2.7, 5.6 and 3.1 of them off
    assert np.all(np.abs(found.mean(axis=0)) < 0.9), found.mean(axis=0)
    assert np.all(np.abs(found) < 4)


def test_masked_samples_have_the_noise_of_those_around_them():
    found = scores(np.where(T > 5, 2.0, 10.0), masked=0.05)
    assert np.all(np.abs(found.mean(axis=0)) < 0.9), found.mean(axis=0)


def test_residuals_are_of_the_noise_that_the_high_band_shows():
    duffing = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
    clean = mf.simulate(
        duffing.model({"d": 0.3, "a": 1.0, "b": 0.5}),
        input="2*sin(1.1*t) + sin(2.3*t)",
        duration=40,
        intervals=1024,
        initial_state=[2.0, 0.0],
    )
    sd = np.where(clean.t > 24, 4.0, 1.0)
    for seed in range(2):
        noise = 0.1 * clean["y"].std() * sd * np.random.default_rng(seed).standard_normal(sd.size)
        fit = mf.fit(clean.assign(y=clean["y"] + noise).weigh(sigma=sd), duffing)
        assert "nothing wrong" in str(fit.check())
        assert abs(fit.params["a"] - 1) < 2.5 * fit.bse["a"]
        # The level is that of the usual sample, and the scale of sigma means nothing.
        assert fit.noise_levels[0, 0] == pytest.approx(0.1 * clean["y"].std(), rel=0.3)


def test_the_level_is_the_mean_that_the_high_band_takes():
    g = np.random.default_rng(3)
    sd = np.where(T > 5, 10.0, 2.0)
    rec = mf.Record(y=np.zeros(T.size), dt=T[1], outputs=["N"], sigma=7 * sd)
    own = spread_of(rec, 1, seen=True)
    usual = own.usual[0] * np.sqrt(
        np.mean(
            [
                rec.assign(N=sd * g.standard_normal(T.size)).noise_level(1)["noise_sd"][0] ** 2
                for _ in range(200)
            ]
        )
    )
    assert usual == pytest.approx(np.median(sd), rel=0.02)
    assert own.rows[0] == pytest.approx(own.usual[0] * sd / np.median(sd))


def test_products_take_the_spread_of_both_outputs():
    prey = mf.Equation(["x' = a*x - b*x*y", "y' = c*x*y - d*y"], outputs=["x", "y"])
    layout = layout_of(prey, Options(), ("x", "y"), (), ((),))
    made = with_spread(layout).formulas
    x, y, left, right = (sympy.Symbol(name) for name in ("x", "y", "spread of x", "spread of y"))
    both = sympy.Symbol("covariance of x and y")
    named = {s: sympy.Symbol(s.name) for s in made.expressions[1]}
    assert x * y - both * left * right in [sympy.sympify(e).xreplace(named) for e in made.expressions[0]]
    assert made.words["channels"] == layout.formulas.words["channels"] + 2


def test_noise_without_a_mean_needs_no_spread():
    linear = mf.Equation("y' + a*y = u")
    layout = layout_of(linear, Options(), ("y",), ("u",), (("smooth",),))
    assert with_spread(layout) is layout
