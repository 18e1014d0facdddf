"""Unsteady lift of a wing at high angle of attack, of indicial type (after Chin and Lan).

The lift y responds to a step of the angle of attack with the part 1 - a at once, and with the rest at the
rate b, as the separation on the wing moves. Its static curve `k*(alpha + c*alpha**3)` bends down towards the
stall. alpha, in rad, is prescribed by the test rig and known.
"""

import modfun as mf

wing = mf.Equation(
    "y' + b*y = k*(1 - a)*(alpha + c*alpha**3)' + k*b*(alpha + c*alpha**3)",
    outputs=["y"],
    inputs=["alpha"],
)
truth = {"b": 1.5, "k": 4.0, "a": 0.4, "c": -0.8}
rec = mf.simulate(
    wing.model(truth),
    input="0.35 + 0.35*sin(t**2/10)",
    duration=20.0,
    intervals=800,
    initial_state=[0.5],
    nsr=0.03,
    seed=1,
)
fit = mf.fit(rec, wing)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
