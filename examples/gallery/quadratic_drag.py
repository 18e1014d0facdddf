"""Drag of a car: rolling resistance c0, and air that goes with the square of the speed.

v is the speed in m/s while the driver plays with the throttle u; b*u is the drive's acceleration in m/s^2.
"""

import modfun as mf

car = mf.Equation("v' + c0 + c2*v**2 = b*u", outputs=["v"])
truth = {"c0": 0.12, "c2": 0.0008, "b": 2.5}
rec = mf.simulate(
    car.model(truth),
    input="0.4 + 0.35*sin(0.11*t) + 0.2*sin(0.37*t + 1)",
    duration=120.0,
    intervals=1200,
    initial_state=[15.0],
    nsr=0.01,
    seed=1,
)
fit = mf.fit(rec, car)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
