"""Van der Pol: a valve oscillator.

Small oscillations grow and large ones are damped. y is the grid voltage and u a signal coupled in.
`(1 - y**2)*y'` is `(y - y**3/3)'`, so the noisy y is never differentiated.
"""

import modfun as mf

valve = mf.Equation("y'' - mu*(1 - y**2)*y' + k*y = b*u")
truth = {"mu": 0.8, "k": 1.0, "b": 0.7}
rec = mf.simulate(
    valve.model(truth),
    input="1.5*sin(t**2/20)",
    duration=30.0,
    intervals=1500,
    initial_state=[0.5, 0.0],
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, valve)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
