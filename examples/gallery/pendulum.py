"""Pendulum at large angles.

A motor at the pivot swings it up to two radians, where sin q is far from q. k = g/l gives the length l, and d
is the friction. Noise multiplies the mean of sin q by `exp(-sigma**2/2)`; the fit corrects this.
"""

import modfun as mf

pendulum = mf.Equation("q'' + d*q' + k*sin(q) = b*m", outputs=["q"], inputs=["m"])
truth = {"d": 0.4, "k": 9.81, "b": 2.0}
rec = mf.simulate(
    pendulum.model(truth),
    input="1.2*sin(2.2*t) + 0.8*sin(3.4*t + 1)",
    duration=15.0,
    intervals=1000,
    initial_state=[1.5, 0.0],
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, pendulum)
print(f"length {9.81 / fit['k']:.3f} m")

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
