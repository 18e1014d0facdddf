"""Duffing oscillator: a beam between magnets.

The spring stiffens as the beam bends. A shaker drives the beam with three tones, and its deflection y is
measured with noise of 10 % of its rms. The cubic spring makes `y**3` of the noisy y a signal; its bias is
removed.
"""

import modfun as mf

beam = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
truth = {"d": 0.3, "a": 1.0, "b": 0.5}
rec = mf.simulate(
    beam.model(truth),
    input="2*sin(1.1*t) + 1.5*sin(2.3*t + 1) + sin(0.45*t)",
    duration=20.0,
    intervals=1024,
    initial_state=[0.5, 0.0],
    nsr=0.1,
    seed=1,
)
fit = mf.fit(rec, beam)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
