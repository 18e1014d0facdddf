"""Parabolic damping: the time-varying system of NASA NAG-1-1065.

The damping of an oscillator falls and rises again during the record, `c(t) = c0 + c1*t + c2*t**2`. Its three
weights are parameters. The fit's `varying` gives the curve with its standard error.
"""

import modfun as mf

system = mf.Equation("y'' + c(t)*y' + k*y = b*u", varying={"c": ["1", "t", "t**2"]})
truth = {"c0": 2.0, "c1": -0.6, "c2": 0.06, "k": 4.0, "b": 3.0}
rec = mf.simulate(
    system.model(truth),
    input="sin(t**2/4) + sin((10 - t)**2/6)",
    duration=10.0,
    intervals=1000,
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, system)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
