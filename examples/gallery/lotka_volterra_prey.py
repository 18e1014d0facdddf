"""Lotka-Volterra with only the hares counted.

The lynxes z are not observed, so they are eliminated: `x*x'' - x'**2 = ...` contains hares only. It does not
determine how much one lynx eats (b), because only `b*z` appears. b is fixed at 1, which defines the unit of
the lynxes.
"""

import modfun as mf

hares = mf.Equation(["x' = a*x - b*x*z", "z' = d*x*z - c*z"], outputs=["x"], params={"b": 1.0})
truth = {"a": 1.0, "d": 0.3, "c": 0.8}
rec = mf.simulate(
    hares.model(truth),
    duration=20.0,
    intervals=800,
    initial_state=[2.0, 0.35],
    nsr=0.02,
    seed=1,
)
fit = mf.fit(rec, hares)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
