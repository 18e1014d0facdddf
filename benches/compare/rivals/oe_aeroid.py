"""aeroid's output error in continuous time (SciPy's least_squares on integrated responses)."""

import aeroid
import numpy as np


class Aeroid:
    """Observer form; the initial state is estimated as parameters, too.

    The package asks for a start: 0.8 and 1.25 times the truth in turn, initial states of .1 of
    their rms. Its inputs run straight
    between samples, so that a held input is looked up by time. `gradient="jax"` integrates by fixed steps and
    compiles for every record; without it a fit of 7161 samples takes many minutes.
    """

    def __init__(self, problem):
        import jax.numpy as jnp

        self.problem = problem
        n, m = problem.poles, problem.zeros
        names = list(problem.names)
        self.states = [f"x{k}" for k in range(1, n + 1)]
        starts = [f"{name}_0" for name in self.states]
        self.size = np.sqrt(np.mean(problem.record(0, 0.0, "zero", True).y ** 2, axis=1))
        factors = np.resize([0.8, 1.25], len(names))
        held = jnp.asarray(problem.u) if problem.hold == "zoh" else None

        def dynamics(t, x, u, p):
            x = [x[k] + p[starts[k]] * self.size[k] for k in range(n)]
            if held is None:
                drive = u[0]
            else:  # at a sample the mean of both sides, so that steps of the integration see no delay
                sides = jnp.floor(t / problem.dt + jnp.array([-1e-6, 1e-6])).astype(int)
                drive = jnp.mean(held[jnp.clip(sides, 0, held.size - 1)])
            rates = []
            for k in range(n):
                rate = -p[names[k]] * x[0] + (x[k + 1] if k + 1 < n else 0.0)
                if k >= n - 1 - m:
                    rate += p[names[n + k - (n - 1 - m)]] * drive
                rates.append(rate)
            return jnp.stack(rates)

        self.model = aeroid.Model(
            states=self.states,
            controls=["u"],
            parameters={
                **dict(zip(names, problem.truth * factors, strict=True)),
                **dict.fromkeys(starts, 0.1),
            },
            dynamics=dynamics,
            outputs=["y"],
            measurement=lambda t, x, u, p: jnp.stack([x[0] + p[starts[0]] * self.size[0]]),
        )
        self.free = [*names, *starts]

    def __call__(self, rec):
        """θ of a record."""
        data = aeroid.FlightData(rec.t, {"u": rec.u[0], "y": rec.y[0]})
        found = aeroid.identify(
            self.model, data, self.free, gradient="jax", x0=np.zeros(self.problem.poles),
            outputs=["y"], simulate_options={"substeps": 4},
        )  # fmt: skip
        return np.array([found.parameters[name] for name in self.problem.names])
