"""Lotka-Volterra when only the hares are counted: nobody sees the lynxes.

The lynxes z are eliminated: x*x'' - x'**2 = ... holds for the hares alone. How strongly a lynx eats (b) is
then out of reach, as only b*z shows; it is held at 1, which counts lynxes in that unit.
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
