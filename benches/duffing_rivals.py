"""What else estimates d, a, b of y'' + d y' + a y + b y³ = u: a weak form with reweighting, output error."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares


class WeakForm:
    """Weak SINDy with known terms, reweighted as WENDy does it.

    Test functions (1 - x²)⁸ on windows of several widths, every second sample; their rows are reduced to the
    leading singular vectors. The covariance follows the first-order noise of the rows at the last estimate;
    neither its gradient nor the bias of y³ is looked at, as in these methods.
    """

    def __init__(self, u, dt, radii=(1.5, 3.0, 5.0), kept=40, iterations=30):
        n = u.size
        t = dt * np.arange(n)
        rows = {0: [], 1: [], 2: []}
        for r in radii:
            for centre in np.arange(r, t[-1] - r, 16 * dt):
                x = np.clip((t - centre) / r, -1, 1)
                inside = np.abs(x) < 1
                rows[0].append(np.where(inside, (1 - x**2) ** 8, 0.0))
                rows[1].append(np.where(inside, -16 * x * (1 - x**2) ** 7 / r, 0.0))
                rows[2].append(
                    np.where(inside, (-16 * (1 - x**2) ** 7 + 224 * x**2 * (1 - x**2) ** 6) / r**2, 0.0)
                )
        turn = np.linalg.svd(np.array(rows[0]), full_matrices=False)[0][:, :kept].T
        self.phi = {k: dt * turn @ np.array(v) for k, v in rows.items()}
        self.right = self.phi[0] @ u
        self.iterations = iterations

    def fit(self, y):
        """θ = (d, a, b)."""
        columns = np.column_stack([-self.phi[1] @ y, self.phi[0] @ y, self.phi[0] @ y**3])
        target = self.right - self.phi[2] @ y
        theta = np.linalg.lstsq(columns, target, rcond=None)[0]
        for _ in range(self.iterations):
            d, a, b = theta
            load = self.phi[2] - d * self.phi[1] + self.phi[0] * (a + 3 * b * y**2)
            c = load @ load.T
            factor = np.linalg.cholesky(c + 1e-10 * np.trace(c) / len(c) * np.eye(len(c)))
            new = np.linalg.lstsq(
                np.linalg.solve(factor, columns), np.linalg.solve(factor, target), rcond=None
            )[0]
            step, theta = np.max(np.abs(new - theta) / np.abs(new)), new
            if step < 1e-9:
                break
        return theta


def output_error(y, u, dt, start):
    """SciPy's least squares over θ and the initial state on solve_ivp's response; u a function of time."""
    t = dt * np.arange(y.size)

    def residual(x):
        d, a, b, y0, v0 = x
        found = solve_ivp(
            lambda s, z: (z[1], u(s) - d * z[1] - a * z[0] - b * z[0] ** 3),
            (0, t[-1]),
            (y0, v0),
            t_eval=t,
            rtol=1e-7,
            atol=1e-9,
        )
        return found.y[0] - y if found.success else np.full(y.size, 1e3)

    return least_squares(residual, [*start, y[0], 0.0], method="lm").x[:3]
