"""Bilinear: a heat exchanger.

The coolant flow u carries off heat in proportion to the temperature y itself. The product of the noisy output
and the known input is a signal like any other.
"""

import modfun as mf

exchanger = mf.Equation("y' + a*y + c*y*u = b*u")
truth = {"a": 0.5, "c": 0.4, "b": 2.0}
rec = mf.simulate(
    exchanger.model(truth),
    input="1 + sin(t**2/15) + 0.6*sin(0.5*t)",
    duration=30.0,
    intervals=600,
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, exchanger)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
