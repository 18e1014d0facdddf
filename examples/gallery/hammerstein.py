"""Hammerstein: a heater with a curved characteristic before a linear furnace.

u is the voltage about its working point and y the temperature. The furnace is of second order and is driven
by `u + c2*u**2 + c3*u**3`. The voltage is held between samples. b multiplies c2 and c3, so some coefficients
are products of parameters.
"""

import modfun as mf
import numpy as np

furnace = mf.Equation("y'' + a1*y' + a2*y = b*(u + c2*u**2 + c3*u**3)")
truth = {"a1": 1.6, "a2": 1.0, "b": 2.0, "c2": 0.5, "c3": -0.3}
steps = np.repeat(np.random.default_rng(3).uniform(-1.2, 1.2, 50), 16)
rec = mf.simulate(
    furnace.model(truth),
    input=np.append(steps, steps[-1]),
    intersample="zoh",
    duration=60.0,
    intervals=800,
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, furnace)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
