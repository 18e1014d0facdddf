"""Roll of a ship in waves.

Eddies damp the roll with the square of its rate. phi is the roll angle and p its rate, both measured, by a
vertical gyro and a rate gyro. m is the moment of the waves divided by the inertia. The restoring moment
softens at large angles.
"""

import modfun as mf

ship = mf.Equation(
    ["phi' = p", "p' + d1*p + d2*p*abs(p) + k1*phi + k3*phi**3 = b*m"],
    outputs=["phi", "p"],
    inputs=["m"],
)
truth = {"d1": 0.05, "d2": 0.4, "k1": 0.6, "k3": -0.5, "b": 1.0}
rec = mf.simulate(
    ship.model(truth),
    input="0.08*sin(0.7*t) + 0.06*sin(0.5*t + 1) + 0.05*sin(1.1*t)",
    duration=120.0,
    intervals=2000,
    initial_state=[0.3, 0.0],
    nsr=0.03,
    seed=1,
)
fit = mf.fit(rec, ship)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
