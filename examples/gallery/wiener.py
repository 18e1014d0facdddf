"""Wiener: a linear tank measured by a curved sensor.

`v = y + c*y**3` is the level that belongs to the sensor's reading y. v obeys a linear equation of second
order. Primes on a bracket differentiate its content.
"""

import modfun as mf

tank = mf.Equation("(y + c*y**3)'' + a1*(y + c*y**3)' + a2*(y + c*y**3) = b*u")
truth = {"c": 0.4, "a1": 1.2, "a2": 2.0, "b": 3.0}
rec = mf.simulate(
    tank.model(truth),
    input="1.5*sin(t**2/12)",
    duration=20.0,
    intervals=800,
    nsr=0.03,
    seed=1,
)
fit = mf.fit(rec, tank)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
