"""Drag of a bicycle: rolling resistance and air.

The rolling resistance is c0; the drag of the air grows with the square of the speed v in m/s. u is the force
on the pedals in units of the rider's usual force, so b is in m/s^2.
"""

import modfun as mf

bicycle = mf.Equation("v' + c0 + c2*v**2 = b*u", outputs=["v"])
truth = {"c0": 0.1, "c2": 0.006, "b": 0.8}
rec = mf.simulate(
    bicycle.model(truth),
    input="0.5 + 0.4*sin(t**2/150) + 0.1*sin(0.2*t)",
    duration=120.0,
    intervals=1200,
    initial_state=[4.0],
    nsr=0.02,
    seed=1,
)
fit = mf.fit(rec, bicycle)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
