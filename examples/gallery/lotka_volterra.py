"""Lotka-Volterra: hares and lynxes, both counted.

Hares x multiply and are eaten; lynxes z starve without them; t is in years. The two equations share only the
product `x*z`. They are fitted together, with the noise of both counts.
"""

import modfun as mf

species = mf.Equation(["x' = a*x - b*x*z", "z' = d*x*z - c*z"], outputs=["x", "z"])
truth = {"a": 1.0, "b": 0.5, "d": 0.3, "c": 0.8}
rec = mf.simulate(
    species.model(truth),
    duration=20.0,
    intervals=400,
    initial_state=[2.0, 0.7],
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, species)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
