"""Delayed feedback: a shower, whose water takes half a second from the tap to the skin.

y is the temperature error, fed back h seconds late; u disturbs it. The shifted output is a signal of its own.
"""

import modfun as mf

shower = mf.Equation("y' + a*y + c*y(t - h) = b*u", params={"h": 0.5})
truth = {"a": 0.4, "c": 1.6, "b": 1.0}
rec = mf.simulate(
    shower.model(truth),
    input="sin(0.8*t) + 0.8*sin(2.1*t + 1)",
    duration=20.0,
    intervals=1000,
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, shower)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
