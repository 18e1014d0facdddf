"""Systems with time lag: roots, reducing transformation, design, simulation, structured uncertainty."""

import importlib
import json
import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.timelag.design import Controller
from modfun.timelag.motion import Motion, history
from modfun.timelag.mu import bound
from modfun.timelag.roots import count_right
from oracle import timelag as oracle
from places import ROOT, measured

DelaySystem, Uncertainty = mf.timelag.DelaySystem, mf.timelag.Uncertainty
A0, A1 = np.array([[-1.0, -3.0], [2.0, -5.0]]), np.array([[1.66, -0.697], [0.93, -0.33]])


def several():
    """Two lags of x and two of u beside lag 0, unstable."""
    return DelaySystem(
        A={0: [[0.3, 1], [-1, 0.2]], 1: [[0.5, -0.2], [0.1, 0.4]], 0.375: [[0, 0.3], [0.2, 0]]},
        B={0: [0.2, 0.3], 0.4: [1, 0], 0.9: [0, -1]},
    )


# Roots --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("a0", "a1", "h"), [(0.5, -2.0, 0.7), (-1.0, 0.6, 2.0), (0.0, -3.0, 1.0)])
def test_roots_of_a_scalar_system_are_lamberts(a0, a1, h):
    found = DelaySystem(A={0: a0, h: a1}).poles(20)
    wanted = oracle.scalar_roots(a0, a1, h)[: len(found)]
    assert len(found) >= 20
    gaps = np.abs(found.values[:, None] - wanted)
    assert np.all(gaps.min(axis=0) < 1e-12 * np.abs(wanted))
    assert np.all(found.residual < 1e-14)


def test_roots_of_the_stored_example():
    given = json.loads(measured("time_delay/examples.json").read_text(encoding="utf-8"))["YiNelsonUlsoy"]
    plant = DelaySystem(A={0: given["A0"], given["h"]: given["A1"]})
    assert np.array_equal(plant.A[0.0], A0)
    for real, imag in given["rightmost"]:
        assert np.abs(plant.poles(20).values - complex(real, imag)).min() < 1e-13


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_no_root_is_missing_or_made_up(n):
    """Roots of random systems satisfy the equation and are as many as the argument principle counts."""
    rng = np.random.default_rng(n)
    a = {h: rng.standard_normal((n, n)) for h in (0.0, 0.31, 0.77, 2.1)}
    found = DelaySystem(A=a).poles(30)
    assert len(found) == found.counted >= 30
    size = sum(np.linalg.norm(m) for m in a.values())
    for root in found.values[:8]:
        near = root + 1e-4 * np.exp(2j * np.pi * np.arange(16) / 16)
        around = np.array([oracle.determinant(a, s) for s in near])
        turns = np.angle(np.roll(around, -1) / around).sum() / (2 * np.pi)
        assert round(turns) == 1
        assert abs(oracle.determinant(a, root)) < 1e-9 * (abs(root) + size) ** n


def test_a_double_root_counts_twice():
    h, a0 = 1.0, -1.0
    found = DelaySystem(A={0: a0, h: -np.exp(a0 * h - 1) / h}).poles(6)
    assert found.values[:2] == pytest.approx([-2.0, -2.0], abs=1e-7)
    assert found.counted == len(found)


def test_a_finite_spectrum_is_found_whole():
    found = DelaySystem(A={0: np.diag([-1.0, -2.0]), 1: [[0, 1], [0, 0]]}).poles(6)
    assert found.values == pytest.approx([-1, -2], abs=1e-12)
    without = DelaySystem(A={0: [[0, 1], [-2, -3]]}).poles(6)
    assert np.sort(without.real) == pytest.approx([-2, -1])


def test_a_root_on_the_contour_is_said():
    plant = DelaySystem(A={0: 1.0, 1: 0.0})
    assert count_right(plant.a, 0.5) == 1
    with pytest.raises(mf.DataError, match="contour"):
        count_right(plant.a, 1.0)


def test_roots_print_and_act_as_an_array():
    found = DelaySystem(A={0: A0, 1: A1}).poles(4)
    assert np.asarray(found).dtype == complex
    assert len(found) == 4
    assert found[0] == pytest.approx(-1.0118752332460628)
    assert "argument principle counts 4" in repr(found)
    assert "<table" in found._repr_html_()


# Transformation -----------------------------------------------------------------------------------


def test_a_is_the_left_characteristic_equation_with_the_exponential_on_the_left():
    from scipy.linalg import expm

    plant = several()
    t = plant.transformation()
    right = sum(expm(-t.A * h) @ m for h, m in plant.A.items())
    assert pytest.approx(right, abs=1e-13) == t.A
    other = sum(m @ expm(-t.A * h) for h, m in plant.A.items())
    assert np.abs(t.A - other).max() > 0.01  # the side matters
    assert np.sort_complex(np.linalg.eigvals(t.A)) == pytest.approx(np.sort_complex(t.kept), abs=1e-12)
    assert pytest.approx(sum(expm(-t.A * r) @ m for r, m in plant.B.items()), abs=1e-14) == t.B
    assert t.residual < 1e-14


def test_z_obeys_its_equation_along_the_delay_equation():
    """z' = Az + Bu by central differences of z on a simulated response, and z by another quadrature."""
    plant = several()
    t = plant.transformation()

    def u(s):
        return np.sin(3 * s) + 0.3 * s

    run = plant.simulate(
        duration=6, dt=0.05, u=u, history=lambda s: np.array([np.cos(s), s]), input_history=u
    )
    e = 2e-3
    for at in (2.5, 4.2):
        z = [t.z(at + k * e, run.state, run.input) for k in (-2, -1, 0, 1, 2)]
        slope = (z[0] - 8 * z[1] + 8 * z[3] - z[4]) / (12 * e)
        assert slope == pytest.approx(t.A @ z[2] + t.B @ run.input(at)[:, 0], abs=1e-7)
    slow = oracle.reduced_state(
        plant.A, plant.B, t.A, 4.2, lambda s: run.state(s)[:, 0], lambda s: run.input(s)[:, 0]
    )
    assert z[2] == pytest.approx(slow, abs=1e-6)


def test_roots_can_be_chosen():
    plant = DelaySystem(A={0: A0, 1: A1}, B={0: [1, 0]})
    roots = plant.poles(8)
    t = plant.transformation(keep=[-1.39895 + 5.09352j, -1.39895 - 5.09352j])
    assert np.sort_complex(np.linalg.eigvals(t.A)) == pytest.approx(np.sort_complex(roots[1:3]), abs=1e-10)
    assert t.left[0] == pytest.approx(roots[0])
    with pytest.raises(mf.SpecError, match="not a root of the system"):
        plant.transformation(keep=[-1.0, -2.0])
    with pytest.raises(mf.SpecError, match="2 states; give 2"):
        plant.transformation(keep=[-1.0])


def test_pairs_alone_make_no_scalar_transformation():
    with pytest.raises(mf.SpecError, match="come in pairs"):
        DelaySystem(A={1: -2.0}, B={0: 1.0}).transformation()


def test_defective_null_vectors_are_named():
    plant = DelaySystem(A={0: [[0, 1], [0, 0]], 1: np.zeros((2, 2))}, B={0: [0, 1]})
    with pytest.raises(mf.SpecError, match="depend on those"):
        plant.transformation()


# Design -------------------------------------------------------------------------------------------


def test_placed_roots_are_roots_of_the_loop():
    """The equations of plant and controller together are singular at each root, integrals by Gauss."""
    plant = several()
    design = plant.place([-1, -1.5])
    assert np.asarray(design) is not design.K
    assert np.sort(design.moved.real) == pytest.approx([-1.5, -1])
    t = design.transformation
    for root in (*design.moved, *t.left[:4]):
        # Closed loop: (sI - sum A e^{-sh}) x = sum B e^{-sr} u, u = -K (Z x + V u).
        s = root + 0j
        z, v = np.eye(2) + 0j, np.zeros((2, 1)) + 0j
        for matrices, own in ((plant.A, "z"), (plant.B, "v")):
            for lag, m in matrices.items():
                x, w = np.polynomial.legendre.leggauss(60)
                for age, weight in zip(lag * (x + 1) / 2, lag * w / 2, strict=True):
                    from scipy.linalg import expm

                    part = weight * np.exp(-s * age) * expm(t.A * (age - lag)) @ m
                    z, v = (z + part, v) if own == "z" else (z, v + part)
        drive = sum(m * np.exp(-s * r) for r, m in plant.B.items())
        plain = s * np.eye(2) - sum(m * np.exp(-s * h) for h, m in plant.A.items())
        whole = np.block([[plain, -drive], [design.K @ z, np.eye(1) + design.K @ v]])
        assert np.linalg.svd(whole, compute_uv=False)[-1] < 1e-11


def test_the_loop_decays_as_placed():
    plant = several()
    design = plant.place([-1, -3])
    run = plant.simulate(design, duration=12, dt=0.005, history=[1.0, 0.5])
    late = run.t > 7
    rate = np.polyfit(run.t[late], np.log(np.linalg.norm(run.x[:, late], axis=0)), 1)[0]
    assert rate == pytest.approx(design.controller(0.005).poles()[0].real, abs=0.01)
    assert rate == pytest.approx(-1, abs=0.03)


def test_lqr_solves_its_riccati_equation():
    plant = several()
    design = plant.lqr([1.0, 2.0], 0.5)
    t = design.transformation
    # A - BK is stable, and P of the loop's Lyapunov equation gives K back.
    from scipy.linalg import solve_continuous_lyapunov

    closed = t.A - t.B @ design.K
    p = solve_continuous_lyapunov(closed.T, -(np.diag([1.0, 2.0]) + 0.5 * design.K.T @ design.K))
    assert pytest.approx(t.B.T @ p / 0.5, abs=1e-10) == design.K
    assert design.moved.real.max() < 0


def test_refusals_name_the_roots():
    plant = DelaySystem(A={0: A0, 1: A1}, B={0: [1, 0]})
    with pytest.raises(mf.SpecError, match=r"-1\.399\+5\.0935j, .* lie right of the line -1\.4"):
        DelaySystem(A={0: A0, 1: A1}, B={0: [1, 0]}).place([-2, -3], line=-1.395 - 0.005)
    with pytest.raises(mf.SpecError, match="2 roots that can be moved"):
        plant.place([-1])
    with pytest.raises(mf.SpecError, match="not pairs"):
        plant.place([-1 + 1j, -2])
    with pytest.raises(mf.SpecError, match="poles that differ"):
        plant.place([-2, -2])
    stuck = DelaySystem(A={0: np.diag([1.0, -1.0]), 1: np.diag([0.2, 0.1])}, B={0: [0, 1]})
    root = f"{stuck.poles(2)[0].real:.5g}"
    for call in (lambda: stuck.place([-1, -2]), lambda: stuck.lqr(1, 1)):
        with pytest.raises(mf.SpecError, match=f"no input reaches the root.*{root}"):
            call()
    many = DelaySystem(A={0: [[0.0]], 1: [[-9.0]]}, B={0: 1.0})
    with pytest.raises(mf.SpecError, match="pairs"):
        many.place([-1])
    with pytest.raises(mf.SpecError, match="R has the eigenvalue -1"):
        plant.lqr(1, -1)
    with pytest.raises(mf.SpecError, match="another system"):
        plant.place([-1, -2], transformation=several().transformation())
    with pytest.raises(mf.SpecError, match="no inputs"):
        DelaySystem(A={0: 1.0}).place([-1])


def test_more_unstable_roots_than_states_are_refused():
    plant = DelaySystem(A={0: [[0, 1], [-400, 0.5]], 1: [[0, 0], [300, 0]]}, B={0: [0, 1]})
    assert np.sum(plant.poles(20).real > 0) > 2
    with pytest.raises(mf.SpecError, match="lie right of the line 0 and would stay"):
        plant.place([-1, -2])


# Simulation ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("dt", [0.1, 0.07, 0.3])
def test_the_method_of_steps_is_met_to_rounding(dt):
    """x' = -x(t - 1), x = 1 before: polynomials, piece by piece."""
    run = DelaySystem(A={1: -1.0}).simulate(duration=3, dt=dt, history=[1.0])
    t = run.t
    wanted = 1 - t + np.where(t > 1, (t - 1) ** 2 / 2, 0) - np.where(t > 2, (t - 2) ** 3 / 6, 0)
    assert run.x[0] == pytest.approx(wanted, abs=1e-13)


def test_simulation_against_fixed_steps():
    plant = several()

    def past(t):
        return np.array([np.cos(t), 0.3 * t])

    def u(t):
        return np.array([np.sin(2 * t) if t >= 0 else 0.5])

    run = plant.simulate(
        duration=3, dt=0.1, history=lambda t: np.array([np.cos(t), 0.3 * t]), u="sin(2*t)", input_history=0.5
    )
    _, coarse = oracle.steps(plant.A, plant.B, past, u, 3.0, 1200)
    _, fine = oracle.steps(plant.A, plant.B, past, u, 3.0, 2400)
    extrapolated = fine[:, ::80] + (fine[:, ::80] - coarse[:, ::40]) / 15
    assert run.x == pytest.approx(extrapolated, abs=1e-8)


@pytest.mark.parametrize("stages", [2, 3, 4])
def test_the_order_is_one_more_than_the_points(stages):
    """A smooth response: x' = a x + b x(t - 1) with the history of one root; halved pieces."""
    plant = DelaySystem(A={0: 0.5, 1: -2.0})
    root = complex(plant.poles(4)[0])
    errors = []
    for dt in (0.5, 0.25, 0.125):
        past = history(lambda t: np.exp(root * t).real[None], 1, "history")
        motion = Motion(plant, dt, round(3 / dt), stages)
        pieces, _ = motion.run(past, np.ones(1), lambda t: np.zeros((0, t.size)), None, np.zeros((0, 0)))
        end = pieces[-1, -1, 0]
        lengths = np.diff(motion.edges).max() * dt
        errors.append((lengths, abs(end - np.exp(3 * root).real)))
    (h1, e1), _, (h3, e3) = errors
    assert h3 < h1 / 1.9
    order = np.log(e1 / e3) / np.log(h1 / h3)
    assert order > stages + 0.6


def test_held_inputs_jump_where_they_should():
    """An integrator of a lagged held input: the sum of what has arrived."""
    plant = DelaySystem(A={0: 0.0}, B={0.25: 1.0})
    u = np.array([1.0, -2.0, 3.0, 0.5, 0.0])
    run = plant.simulate(duration=0.4, dt=0.1, u=u, intersample="zoh", input_history=0.7)
    wanted = [0.0, 0.07, 0.14, 0.175 + 0.05, 0.175 + 0.1 - 0.1]
    assert run.x[0] == pytest.approx(wanted, abs=1e-14)


def test_a_jump_at_the_start_and_states_between_samples():
    run = DelaySystem(A={1: -1.0}).simulate(duration=2, dt=0.3, initial_state=[1.0])
    assert run.state([0.5, -0.5, 1.5])[0] == pytest.approx([1.0, 0.0, 0.5])
    with pytest.raises(mf.SpecError, match="ends at"):
        run.state(2.5)


def test_the_controllers_z_is_that_of_the_integrals():
    plant = several()
    design = plant.place([-1, -1.5])
    t, errors = design.transformation, []
    for dt in (0.04, 0.02, 0.01):
        run = plant.simulate(design, duration=4, dt=dt, history=lambda t: np.array([np.cos(t), np.sin(t)]))
        some = slice(round(2 / dt), None, round(0.4 / dt))
        wanted = np.array([t.z(s, run.state, run.input, step=dt) for s in run.t[some]]).T
        errors.append(np.abs(run.z[:, some] - wanted).max())
        assert run.u == pytest.approx(-design.K @ run.z)
    assert errors[1] < 5e-5
    assert errors[0] > 2 * errors[1] > 4 * errors[2]  # steps of u bend x


def test_naive_sums_destabilise_and_the_controller_does_not(monkeypatch):
    """x' = x + u(t - 1), root 1 to -5: sums of 8 values of u under fast sampling make the loop explode."""
    monkeypatch.syspath_prepend(str(ROOT / "benches"))
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    naive = importlib.import_module("timelag").naive
    plant = DelaySystem(A={0: 1.0}, B={1.0: 1.0})
    design = plant.place([-5.0])
    safe = plant.simulate(design, duration=16, dt=0.0125, history=[1.0])
    assert np.abs(safe.x[0, safe.t > 6]).max() < 1e-4
    for nodes in (8, 16):
        sums = plant.simulate(naive(design, 1.0, nodes), duration=16, dt=0.0125, history=[1.0])
        assert np.abs(sums.u[0, sums.t > 14]).max() > 1e3 * np.abs(safe.u[0]).max()


def test_a_hold_that_is_too_long_is_said():
    plant = DelaySystem(A={0: 1.0}, B={1.0: 1.0})
    design = plant.place([-8.0])
    with pytest.warns(mf.ModfunWarning, match="sample faster"):
        plant.simulate(design, duration=1, dt=0.5, history=[1.0])


def test_the_controller_in_real_time_is_that_of_the_simulation():
    plant = several()
    design = plant.place([-1, -1.5])
    run = plant.simulate(design, duration=3, dt=0.05, initial_state=[1.0, 0.5])
    live = design.controller(0.05)
    assert isinstance(live, Controller)
    u = np.array([live.step(x) for x in run.x.T]).T
    assert np.array_equal(u, run.u)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: DelaySystem(A={-1: 1.0}), "at least 0"),
        (lambda: DelaySystem(A={0: [[1, 2]]}), r"must be \(1, 1\)"),
        (lambda: DelaySystem(A={0: np.nan}), "finite"),
        (lambda: DelaySystem(A={0: "a"}), "is text; give real numbers"),
        (lambda: DelaySystem(A={}), "empty"),
        (lambda: DelaySystem(A={0: np.eye(2)}, B={0: [1.0]}), r"B\[0\] has shape \(1, 1\)"),
        (lambda: DelaySystem(A={0: np.eye(2)}, C=[1.0]), "C has shape"),
        (lambda: several().poles(0), "at least 1"),
        (lambda: several().simulate(duration=1, dt=0), "above 0"),
        (lambda: several().simulate(duration=0.01, dt=0.1), "at least one interval"),
        (lambda: several().simulate(duration=1, dt=0.1, history=[1.0]), r"history has shape \(1,\)"),
        (lambda: several().simulate(duration=1, dt=0.1, history=lambda t: np.ones(3)), "must give"),
        (lambda: several().simulate(duration=1, dt=0.1, u=[[1.0, 2.0]]), "2 samples for 11"),
        (lambda: several().simulate([1.0], duration=1, dt=0.1), r"K has shape \(1, 1\)"),
        (lambda: several().simulate(lambda *a: [np.nan], duration=1, dt=0.1), "the law gives"),
        (lambda: several().mu([1.0, 1.0], A={0: np.eye(2)}), "not stable without errors"),
        (lambda: several().mu(several().place([-1, -2])), "nothing is uncertain"),
        (lambda: several().mu(several().place([-1, -2]), A={0.2: np.eye(2)}), "has the lags 0, 0.375, 1"),
        (lambda: several().place("fast"), "place: poles='fast' is text; give real numbers"),
        (lambda: several().transformation(keep=[np.nan, 1]), "not a root of the system"),
        (lambda: several().simulate("K", duration=1, dt=0.1), "K='K' is text; give real numbers"),
        (lambda: several().simulate(duration="long", dt=0.1), "duration='long' must be a number"),
        (lambda: several().simulate(duration=1e9, dt=0.1), "shorter time"),
        (lambda: DelaySystem(A={0: 0.0}, B={1: 1.0}).lqr(0, 1), "no stabilising solution"),
        (lambda: Uncertainty(A={0: 1.0}, kind="odd"), "choose among"),
        (lambda: Uncertainty(), "give A= or B="),
    ],
)
def test_bad_input_is_refused_in_words(make, words):
    with pytest.raises(mf.ModfunError, match=words):
        make()


def test_an_unstable_response_that_overflows_is_said():
    with pytest.raises(mf.DataError, match="overflows at t"):
        DelaySystem(A={0: 50.0}).simulate(duration=100, dt=0.1, initial_state=[1.0])


# Structured uncertainty ---------------------------------------------------------------------------


def test_mu_of_one_full_block_is_the_largest_singular_value():
    rng = np.random.default_rng(0)
    m = rng.standard_normal((4, 4)) + 1j * rng.standard_normal((4, 4))
    same = np.zeros(4, dtype=int)
    assert bound(m, same, same)[0] == pytest.approx(np.linalg.norm(m, 2))


def test_mu_of_a_dyad_is_the_sum_of_its_entries():
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((2, 5)) + 1j * rng.standard_normal((2, 5))
    found = bound(np.outer(a, b), np.arange(5), np.arange(5))[0]
    assert found == pytest.approx(np.abs(a * b).sum(), rel=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_the_bound_is_exact_for_three_complex_blocks(seed):
    """No gap for three blocks (Packard and Doyle); the phases of the grid are 1e-3 short at most."""
    rng = np.random.default_rng(seed)
    m = rng.standard_normal((3, 3)) + 1j * rng.standard_normal((3, 3))
    found, least = bound(m, np.arange(3), np.arange(3))[0], oracle.mu_of_scalars(m)
    assert least * (1 - 1e-9) <= found <= least * (1 + 1e-3)


def test_the_margin_of_a_scalar_loop_is_exact():
    """x' = (a + d)x + u(t - 1) at K: real errors at frequency 0 are the worst, so the bound is the truth.

    The loop's characteristic function at s = 0 vanishes where d reaches 1/|M(0)|.
    """
    plant = DelaySystem(A={0: 1.0}, B={1.0: 1.0})
    design = plant.place([-0.5])
    found = plant.mu(design, A={0: 1.0})
    assert found.peak_omega == 0
    # (s - 1 - d) x = e^{-s} u, u = -K (x + int_0^1 e^{s'-1} u): at s = 0 u (1 + K (1 - 1/e)) = -K x.
    k = design.K[0, 0]
    d = k / (1 + k * (1 - np.exp(-1))) - 1
    assert found.margin == pytest.approx(abs(d), rel=1e-9)


def test_within_the_margin_the_delay_equation_is_stable_and_beyond_it_is_not():
    plant = several()
    design = plant.place([-1, -1.5])
    errors = [Uncertainty(A={0: [[0, 0], [1, 0]], 1: [[0, 0], [0.5, 0]]})]
    found = plant.mu(design, errors)
    assert np.all(found.upper > 0)
    rates = {}
    for size in (0.9, 3.0):
        for sign in (-1, 1):
            d = sign * size * found.margin
            wrong = DelaySystem(
                A={h: m + d * np.asarray(errors[0].A.get(h, 0)) for h, m in plant.A.items()}, B=plant.B
            )
            run = wrong.simulate(design, duration=40, dt=0.04, initial_state=[1, 1])
            early, late = (np.abs(run.x[:, run.t > t]).max() for t in (20, 32))
            rates[sign * size] = late / early
    assert all(rates[s] < 1 for s in (0.9, -0.9))
    assert max(rates.values()) >= 1


def test_mu_over_given_frequencies_and_in_print():
    plant = several()
    design = plant.place([-1, -1.5])
    found = plant.mu(design, A={0: 0.1 * np.eye(2)}, B={0.4: [0.1, 0]}, omega=[0.5, 1.0])
    assert list(found.omega) == [0.5, 1.0]
    assert "D-scaling" in repr(found)
    whole = plant.mu(design, A={0: 0.1 * np.eye(2)}, B={0.4: [0.1, 0]})
    assert whole.peak >= found.peak - 1e-9
    double = plant.mu(design, A={0: 0.2 * np.eye(2)}, B={0.4: [0.2, 0]})
    assert double.peak == pytest.approx(2 * whole.peak, rel=1e-3)
    full = plant.mu(design, Uncertainty(A={0: 0.1 * np.eye(2)}, B={0.4: np.zeros((2, 1))}, kind="full"))
    assert full.peak > 0


# From data ----------------------------------------------------------------------------------------


def test_equations_carry_the_matrices_there_and_back():
    pytest.importorskip("sympy")
    model = mf.timelag.equation(
        A={0: [["a", 1], [-2, "2*d"]], "h": [[0, "c"], [0.5, 0]]},
        B={0.25: ["b", 0]},
        params={"h": mf.Free(min=0.1, max=1)},
    )
    plant = mf.timelag.from_fit(model.model({"a": -1.0, "d": -0.5, "c": 0.3, "b": 2.0, "h": 0.6}))
    assert list(plant.A) == [0.0, 0.6]
    assert plant.A[0.0] == pytest.approx(np.array([[-1.0, 1], [-2, -1]]))
    assert plant.A[0.6] == pytest.approx(np.array([[0, 0.3], [0.5, 0]]))
    assert plant.B[0.25] == pytest.approx(np.array([[2.0], [0]]))
    assert plant.states == ("x1", "x2")


def test_an_equation_of_second_order_has_its_states():
    pytest.importorskip("sympy")
    model = mf.Equation("y'' + 0.4*y' + 2*y + c*y(t - h) = u(t - 0.1)", params={"h": mf.Free(min=0.1, max=2)})
    plant = mf.timelag.from_fit(model.model({"c": 0.7, "h": 0.5}))
    assert plant.A[0.0] == pytest.approx(np.array([[0, 1], [-2, -0.4]]))
    assert plant.A[0.5] == pytest.approx(np.array([[0, 0], [-0.7, 0]]))
    assert plant.B[0.1] == pytest.approx(np.array([[0.0], [1]]))
    assert pytest.approx(np.array([[1.0, 0]])) == plant.C
    linear = mf.timelag.from_fit(mf.ss(A0, [[1.0], [0]], [[0, 1.0]], delay=0.3))
    assert list(linear.B) == [0.0, 0.3]


def test_what_is_not_linear_is_refused():
    pytest.importorskip("sympy")
    for text in ("y' + y**3 + y(t - 0.5) = u", "y' + y(t - 0.5)*y = u", "y' + t*y = u", "y' + y = u'"):
        with pytest.raises(mf.SpecError, match="from_fit"):
            mf.timelag.from_fit(mf.Equation(text).model({}))
    with pytest.raises(mf.SpecError, match="no model"):
        mf.timelag.from_fit("fit")
    with pytest.raises(mf.SpecError, match="2 by 2"):
        mf.timelag.equation(A={0: [["a", 1], [1, "b"]], 1.0: [["c", 0]]})


def test_records_of_a_delay_system():
    plant = DelaySystem(A={0: A0, 1: A1}, B={0.4: [1, 0]})
    rec = mf.simulate(plant, input="sin(t)", duration=4.0, intervals=100, initial_state=[1.0, 0.5])
    run = plant.simulate(duration=4.0, dt=0.04, u="sin(t)", history=[1.0, 0.5])
    assert rec.outputs == ("x1", "x2")
    assert np.array_equal(rec.y, run.x)
    noisy = mf.simulate(plant, input="sin(t)", duration=4.0, intervals=100, nsr=0.1, seed=2)
    again = mf.simulate(plant, input="sin(t)", duration=4.0, intervals=100, nsr=0.2, seed=2)
    clean = mf.simulate(plant, input="sin(t)", duration=4.0, intervals=100)
    assert again.y - clean.y == pytest.approx(2 * (noisy.y - clean.y))
    with pytest.raises(mf.SpecError, match="DelaySystem"):
        mf.simulate("plant", duration=1.0, intervals=10)


def test_the_example_closes_the_circle(monkeypatch):
    """Ten estimates within 4 standard errors: false alarm .06 %, and the seed is fixed."""
    pytest.importorskip("sympy")
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    example = importlib.import_module("time_lag")
    _, fit, identified, design, (free, controlled) = example.main()
    assert fit.success
    truth = np.array([example.TRUTH[name] for name in fit.param_names])
    assert np.all(np.abs(fit.params - truth) < 4 * fit.bse)
    assert np.all(fit.bse < 0.15 * np.abs(truth))
    assert list(identified.A)[1] == fit["h"]
    assert design.moved.real == pytest.approx([-2.5, -3])
    assert np.abs(controlled.x[:, controlled.t > 3]).max() < 0.3 * np.abs(free.x[:, free.t > 3]).max()
    blocks = mf.timelag.errors(fit)
    assert len(blocks) == len(fit.param_names) - 1  # the lag is taken as exact
    assert identified.mu(design, blocks, omega=[0.1, 1.0, 3.0]).margin > 1
    with pytest.raises(mf.SpecError, match="between 0 and 1"):
        mf.timelag.errors(fit, level=95)


@pytest.mark.parametrize("options", [{}, {"harmonics": 40}, {"harmonics": 100}, {"harmonics": 20}])
def test_a_lag_is_found_where_its_bounds_begin_at_zero(monkeypatch, options):
    """Unweighted rows under noise prefer h = 0, where the columns of x(t) and x(t - h) are one."""
    pytest.importorskip("sympy")
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    example = importlib.import_module("time_lag")
    model = mf.timelag.equation(
        A={0: [["a11", "a12"], ["a21", "a22"]], "h": [["c11", "c12"], ["c21", "c22"]]},
        B={0.4: ["b", 0]},
        params={"h": mf.Free(min=0, max=2.0)},
    )
    fit = mf.fit(example.record(nsr=0.1, seed=3), model, **options)
    assert fit.success
    assert abs(fit["h"] - 1) < 4 * fit.bse[fit.param_names.index("h")] < 0.2


# Plots --------------------------------------------------------------------------------------------


def test_plots_return_their_axes():
    plt = pytest.importorskip("matplotlib.pyplot")
    import matplotlib

    matplotlib.use("Agg")
    plant = several()
    design = plant.place([-1, -1.5])
    assert plant.poles(6).plot().get_xlabel() == "real part (1/s)"
    run = plant.simulate(design, duration=1, dt=0.1, initial_state=[1, 0])
    assert len(run.plot()) == 3
    here = plt.figure().add_subplot()
    assert plant.mu(design, A={0: 0.1 * np.eye(2)}, omega=[0.1, 1.0]).plot(ax=here, hz=True) is here


def test_nothing_here_warns():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        several().place([-1, -1.5])
