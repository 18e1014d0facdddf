"""Delayed feedback: a shower.

The water takes half a second from the tap to the skin. y is the temperature error, fed back h seconds late,
and u disturbs it. The delayed output is treated as a signal of its own.
"""

import modfun as mf

shower = mf.Equation("y' + a*y + c*y(t - h) = b*u", params={"h": mf.Free(0.3, min=0, max=1)})
truth = {"a": 0.4, "c": 1.6, "h": 0.5, "b": 1.0}
rec = mf.simulate(
    shower.model(truth),
    input="2*sin(t**2/12) + 1.5*sin((20 - t)**2/15)",
    duration=20.0,
    intervals=1000,
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, shower, harmonics=12)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
