"""Model reduction: norms and Hankel values by plain formulas, never worse than balanced truncation."""

import json
import subprocess
import sys

import matplotlib
import modfun as mf
import numpy as np
import pytest
from oracle import norms
from places import ROOT, measured
from scipy import signal, sparse

CLASSIC = mf.tf([1, 7, 24, 24], [1, 10, 35, 50, 24])


def random_system(n=8, outputs=2, inputs=2, seed=0):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n))
    a -= (np.max(np.linalg.eigvals(a).real) + 0.3) * np.eye(n)
    return mf.ss(a, rng.normal(size=(n, inputs)), rng.normal(size=(outputs, n)))


def difference(one, other):
    """A, B, C, D of one less other."""
    one, other = one.to_ss(), other.to_ss()
    zero = np.zeros((one.order, other.order))
    return (
        np.block([[one.A, zero], [zero.T, other.A]]),
        np.vstack([one.B, other.B]),
        np.hstack([one.C, -other.C]),
        one.D - other.D,
    )


def test_the_classic_fourth_order():
    """Shen's example: balanced truncation has .002388, the least known is .00228187."""
    red = mf.reduce(CLASSIC, 2)
    a, b, c, d = difference(CLASSIC, red.model)
    assert norms.h2(a, b, c) ** 2 == pytest.approx(red.h2_error**2, rel=1e-9)
    assert red.h2_error**2 <= 1.0001 * 2.28187e-3
    assert red.errors["h2"][1] ** 2 == pytest.approx(2.388224887e-3, rel=1e-8)
    assert red.errors["h2_relative"] == pytest.approx([7.18e-2, 7.34e-2], abs=5e-5)
    assert red.hankel == pytest.approx(
        [0.5178709963842122, 0.03085793752861964, 0.012415490056094549, 0.0005714510882978587], rel=1e-10
    )
    assert red.hankel == pytest.approx(
        norms.hankel(*difference(CLASSIC, mf.tf([0], [1, 1]))[:3])[:4], rel=1e-6
    )
    assert red.bound == pytest.approx(2 * red.hankel[2:].sum())
    assert red.hinf_error == pytest.approx(norms.hinf(a, b, c, d), rel=1e-6)
    assert red.errors["hinf"][1] <= red.bound * (1 + 1e-9)
    assert red.model.is_stable
    assert red.success


def test_a_structure_gives_the_same_as_an_order():
    tf2 = mf.TransferFunction(poles=2, zeros=1)
    red = mf.reduce(CLASSIC, tf2)
    assert red.h2_error == pytest.approx(mf.reduce(CLASSIC, 2).h2_error, rel=1e-8)
    assert mf.TransferFunction.from_system(red.model).poles == 2
    balanced = mf.reduce(CLASSIC, tf2, method="balanced")
    assert balanced.model.num == pytest.approx([0.8216223275156829, 0.4541841068248611], rel=1e-9)
    assert balanced.model.den == pytest.approx([1, 1.2679152873139465, 0.46629561422038035], rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("order", [2, 3, 5])
def test_never_worse_than_balanced_truncation(seed, order):
    system = random_system(seed=seed)
    for weight, name in (("h2", "h2"), ("flat", "hinf")):
        red = mf.reduce(system, order, weight=weight)
        assert red.model.is_stable
        assert red.model.order == order
        this, balanced = red.errors[name]
        assert this <= balanced * (1 + 1e-6)
        a, b, c, d = difference(system, red.model)
        assert red.h2_error == pytest.approx(norms.h2(a, b, c), rel=1e-6)
        on_grid = norms.largest_gain(a, b, c, d, np.append(0, np.geomspace(1e-3, 1e3, 4000)))
        assert on_grid <= red.hinf_error * (1 + 1e-9)
        assert red.hinf_error <= 1.002 * on_grid


def test_the_h2_minimum_is_one():
    """Small changes of the model's matrices raise the H2 error, by the plain formula."""
    system = random_system()
    red = mf.reduce(system, 3)
    rng = np.random.default_rng(0)
    for _ in range(20):
        moved = [m + 1e-3 * np.linalg.norm(m) * rng.normal(size=m.shape) for m in red.model.matrices[:3]]
        a, b, c, _ = difference(system, mf.ss(*moved))
        assert norms.h2(a, b, c) > red.h2_error


def test_flat_is_near_the_least_largest_error():
    """No model of one pole on a fine lattice of poles and gains has a largest error 1 % below it."""
    system = mf.tf([1, 3], [1, 4, 3.5])
    red = mf.reduce(system, 1, weight="flat")
    omega = np.concatenate([[0], np.geomspace(1e-3, 1e3, 150)])  # few: errors between lines count for less
    target = system.frequency_response(omega).response[0, 0]
    pole, gain = np.meshgrid(np.linspace(0.3, 3, 300), np.linspace(0.3, 1.6, 300))
    sizes = np.abs(target[:, None, None] - gain / (1j * omega[:, None, None] / pole + 1)).max(axis=0)
    assert red.hinf_error <= 1.01 * sizes.min()


def test_relative_serves_all_decades():
    poles = np.geomspace(1e-2, 1e4, 7)
    system = mf.ss(-np.diag(poles), np.ones(7), poles)
    plain, relative = (mf.reduce(system, 3, weight=weight) for weight in ("h2", "relative"))
    assert relative.errors["largest_relative"][0] < 0.5 * plain.errors["largest_relative"][0]
    assert plain.h2_error < relative.h2_error


def test_a_function_weighs_and_a_band_limits():
    near_one = mf.reduce(random_system(seed=3), 2, weight=lambda w: 1 / (1 + w**2))
    assert near_one.errors["cost"][0] <= near_one.errors["cost"][1]
    system = random_system(seed=3)
    low, high = (mf.reduce(system, 2, band=band).errors["cost"] for band in (0.5, (2.0, 20.0)))
    assert low[0] < low[1]
    assert high[0] < high[1]


def test_the_dc_gain_is_exact_by_option():
    system = random_system(n=8)
    gain = system.frequency_response([0.0]).response[:, :, 0].real
    for method in ("awls", "balanced"):
        red = mf.reduce(system, 4, dcgain=True, method=method)
        assert red.model.frequency_response([0.0]).response[:, :, 0].real == pytest.approx(gain, rel=1e-8)
    tied = mf.reduce(CLASSIC, mf.TransferFunction(poles=2), dcgain=True)
    assert tied.model.dcgain() == pytest.approx(1, rel=1e-10)
    assert tied.h2_error > mf.reduce(CLASSIC, 2).h2_error


def test_poles_that_are_not_stable_are_kept_with_their_residues():
    integrator = mf.tf([1, 7, 24, 24], np.polymul([1, 10, 35, 50, 24], [1, 0]))
    unstable = mf.tf([1, 7, 24, 24], np.polymul([1, 10, 35, 50, 24], [1, -2]))
    for system, pole in ((integrator, 0.0), (unstable, 2.0)):
        for structure in (3, mf.TransferFunction(poles=3)):
            red = mf.reduce(system, structure)
            found = red.model.poles()
            assert np.min(np.abs(found - pole)) < 1e-9
            assert np.sum(found.real > -1e-9) == 1
            assert np.isfinite(red.h2_error)
            assert 0 < red.errors["h2_relative"][0] < 0.1
            assert "are kept" in red.notes[0]
            near = 1j * 1e-4 + pole
            ratio = np.polyval(np.polymul(red.model.num, system.den), near) / np.polyval(
                np.polymul(system.num, red.model.den), near
            )
            assert abs(ratio - 1) < 1e-3
    with pytest.raises(mf.SpecError, match="not fewer than are kept"):
        mf.reduce(mf.tf([1], np.polymul([1, 0, 0], [1, 3, 2])), 1)
    held = mf.TransferFunction(poles=2, zeros=0, params={"a2": 0.0})
    with pytest.raises(mf.SpecError, match=r"name a band="):
        mf.reduce(integrator, held)
    red = mf.reduce(integrator, held, band=(0.01, 0.5), weight="relative")
    assert np.min(np.abs(red.model.poles())) == 0
    assert red.errors["largest_relative"][0] < 0.05


def test_delays_are_kept_or_approximated():
    late = mf.tf([1, 7, 24, 24], [1, 10, 35, 50, 24], delay=0.3)
    kept = mf.reduce(late, 2)
    assert kept.model.delay == 0.3
    assert kept.h2_error == pytest.approx(mf.reduce(CLASSIC, 2).h2_error, rel=1e-9)
    same = mf.reduce(late, mf.TransferFunction(poles=2, delay=0.3))
    assert same.model.delay == 0.3
    assert same.h2_error == pytest.approx(kept.h2_error, rel=1e-8)
    without = mf.reduce(late, mf.TransferFunction(poles=3))
    assert without.model.delay == 0
    assert "poles take their place" in without.notes[0]
    assert kept.h2_error < without.h2_error < 0.5
    free = mf.reduce(late, mf.TransferFunction(poles=2, delay=mf.Free(min=0, max=1)), band=30.0)
    assert free.model.delay == pytest.approx(0.3, abs=0.03)


def test_a_feedthrough_is_kept():
    system = mf.tf([2, 3, 4, 1], [1, 4, 6, 3])
    red = mf.reduce(system, 2)
    assert red.model.D[0, 0] == pytest.approx(2)
    red = mf.reduce(system, mf.TransferFunction(poles=2, zeros=2))
    assert red.model.num[0] == pytest.approx(2)
    assert np.isfinite(red.h2_error)
    with pytest.raises(mf.SpecError, match="feedthrough"):
        mf.reduce(system, mf.TransferFunction(poles=2, zeros=1))


def test_several_channels_with_one_denominator_or_their_own():
    system = random_system(n=6)
    state = mf.reduce(system, 3)
    common = mf.reduce(system, mf.TransferFunction(poles=3, denominator="common"))
    separate = mf.reduce(system, mf.TransferFunction(poles=3, denominator="separate"))
    # Full residues hold residues of rank one, own denominators hold a common one.
    assert separate.h2_error <= common.h2_error * (1 + 1e-6)
    assert common.h2_error <= state.h2_error * (1 + 1e-6)
    assert state.h2_error <= state.errors["h2"][1]
    a, b, c, _ = difference(system, common.model)
    assert common.h2_error == pytest.approx(norms.h2(a, b, c), rel=1e-6)


def test_lines_of_a_frequency_response():
    omega = np.geomspace(0.01, 100, 80)
    response = CLASSIC.frequency_response(omega)
    for given in (response, mf.FrequencyResponse(omega=omega[::-1], response=response.response[:, :, ::-1])):
        red = mf.reduce(given, 2)
        assert red.hankel.size == 0
        assert np.isnan(red.bound)
        assert red.h2_error == pytest.approx(mf.reduce(CLASSIC, 2).h2_error, rel=0.05)
    gains = response.response[0, 0]
    bode = {"magnitude_db": 20 * np.log10(np.abs(gains)), "phase_deg": np.angle(gains, deg=True)}
    points = mf.reduce(mf.FrequencyResponse(omega=omega, **bode), 2)
    assert points.model.den == pytest.approx(red.model.den, rel=1e-8)
    flat = mf.reduce(response, mf.TransferFunction(poles=2), weight="flat")
    assert flat.hinf_error < red.hinf_error
    ones = mf.reduce(response, mf.TransferFunction(poles=2), weight=np.ones(80))
    again = mf.reduce(response, mf.TransferFunction(poles=2), weight=np.ones((1, 1, 80)))
    assert ones.model.den == pytest.approx(again.model.den, rel=1e-9)
    four = mf.reduce(random_system().frequency_response(omega), 8)
    assert four.errors["h2_relative"][0] < 1e-6
    with pytest.raises(mf.SpecError, match="no states to balance"):
        mf.reduce(response, 2, method="balanced")
    with pytest.raises(mf.SpecError, match=r"a line at 0 rad/s"):
        mf.reduce(response, 2, dcgain=True)
    with pytest.raises(mf.SpecError, match=r"line\(s\) lie"):
        mf.reduce(response, 2, band=(0.0099, 0.0101))


def test_systems_of_other_packages_and_matrices():
    control = pytest.importorskip("control")
    num, den = [1, 7, 24, 24], [1, 10, 35, 50, 24]
    state = CLASSIC.to_ss()
    expected = mf.reduce(CLASSIC, 2).h2_error
    for given in (
        control.tf(num, den),
        control.ss(*state.matrices),
        signal.TransferFunction(num, den),
        signal.StateSpace(*state.matrices),
        (state.A, state.B, state.C),
        (state.A, state.B[:, 0], state.C[0], [[0.0]]),
        (sparse.csr_matrix(state.A), sparse.csc_matrix(state.B), state.C),
    ):
        assert mf.reduce(given, 2).h2_error == pytest.approx(expected, rel=1e-8)
    omega = np.geomspace(0.01, 100, 50)
    frd = CLASSIC.frequency_response(omega).to_control()
    assert mf.reduce(frd, 2).h2_error == pytest.approx(
        mf.reduce(CLASSIC.frequency_response(omega), 2).h2_error, rel=1e-9
    )


def heat(n):
    """A rod of n cells heated at one end, measured at the other."""
    a = (
        sparse.diags([np.ones(n - 1), -2 * np.ones(n), np.ones(n - 1)], [-1, 0, 1], format="csc")
        * (n + 1.0) ** 2
    )
    b, c = np.zeros((n, 1)), np.zeros((1, n))
    b[n // 3, 0], c[0, 2 * n // 3] = n + 1.0, 1.0
    return a, b, c


def test_a_large_sparse_system():
    large = mf.reduce(heat(8000), 6)
    small = mf.reduce(heat(398), 6)
    assert large.hankel[:6] == pytest.approx(small.hankel[:6], rel=0.02)
    assert large.errors["h2"][0] <= large.errors["h2"][1]
    omega = np.array([0.5, 5.0, 50.0])
    a, b, c = heat(8000)
    from scipy.sparse.linalg import spsolve

    exact = [c @ spsolve((1j * w * sparse.identity(8000) - a).tocsc(), b[:, 0]) for w in omega]
    found = large.model.frequency_response(omega).response[0, 0]
    assert np.abs(found - np.ravel(exact)).max() < 1.01 * large.hinf_error
    with pytest.raises(mf.DataError, match="must be stable"):
        mf.reduce((-a, b, c), 6)


@pytest.mark.parametrize("name", ["building", "heat", "iss"])
def test_slicot(name):
    held = np.load(measured(f"slicot/{name}.npz"))
    n = max(held["B"].shape)
    a = sparse.coo_matrix((held["A_val"], (held["A_row"], held["A_col"])), shape=(n, n))
    given = (a, held["B"].reshape(n, -1), held["C"].reshape(-1, n))
    red = mf.reduce(given, 6)
    stored = np.sort(held["hsv"].ravel())[::-1]
    count = min(stored.size, red.hankel.size)
    assert red.hankel[:count] == pytest.approx(stored[:count], abs=2e-11 * stored[0])
    assert red.errors["h2"][0] <= red.errors["h2"][1] * (1 + 1e-6)
    flat = mf.reduce(given, 6, weight="flat")
    assert flat.errors["hinf"][0] <= flat.errors["hinf"][1] * (1 + 1e-6)
    assert flat.errors["hinf"][1] <= red.bound * (1 + 1e-6)


def test_stored_classic():
    held = json.loads(measured("mor_classic/g4.json").read_text(encoding="utf-8"))
    red = mf.reduce(mf.tf(held["num"], held["den"]), 2)
    assert red.hankel == pytest.approx(held["hsv"], rel=1e-10)
    assert red.h2_error**2 <= 1.002 * 2.28187e-3
    assert red.errors["h2"][1] ** 2 == pytest.approx(held["bt2"]["ise_impulse"], rel=1e-6)


def test_what_it_says_of_itself():
    matplotlib.use("Agg")
    red = mf.reduce(CLASSIC, 2)
    assert "balanced truncation" in red.summary()
    assert "Hankel singular values: 0.5179, 0.03086" in repr(red)
    assert "<table>" in red._repr_html_()
    ax = red.plot(hz=True)
    assert len(ax.lines) == 4
    assert mf.plot.reduction(red, ax=ax) is ax
    whole = mf.reduce(mf.ss(np.diag([-1.0, -2, -3, -4]), [1.0, 1, 0, 0], [1.0, 1, 1, 1]), 3)
    assert whole.errors["h2_relative"][0] < 1e-10
    assert "nothing was left out" in whole.notes[0]


@pytest.mark.parametrize(
    ("args", "options", "words"),
    [
        ((CLASSIC, 4), {}, "4 poles for a system of 4 states"),
        ((CLASSIC, 0), {}, "0 poles"),
        ((CLASSIC, True), {}, "give the number of poles"),
        ((CLASSIC, "2"), {}, "give the number of poles"),
        ((CLASSIC, 2), {"weight": "h3"}, "did you mean 'h2'"),
        ((CLASSIC, 2), {"weight": np.ones(3)}, "goes with a frequency response"),
        ((CLASSIC, 2), {"weight": lambda w: np.nan * w}, "one finite number"),
        ((CLASSIC, 2), {"method": "balance"}, "did you mean 'balanced'"),
        ((CLASSIC, 2), {"band": (3, 1)}, "0 <= lower < upper"),
        ((CLASSIC, mf.TransferFunction(poles=2, zeros=0)), {"method": "balanced"}, "cannot make"),
        (((np.eye(2), [1, 1]), 1), {}, "a tuple is"),
        (((-np.eye(2), [1, 1, 1], [1, 1]), 1), {}, "have shapes"),
        (((-np.eye(2), [1, np.inf], [1, 1]), 1), {}, "nan or inf"),
        ((random_system(), mf.TransferFunction(poles=2)), {}, "denominator="),
    ],
    ids=range(14),
)
def test_bad_input_is_named(args, options, words):
    with pytest.raises(mf.SpecError, match=words):
        mf.reduce(*args, **options)


@pytest.mark.process
def test_the_example_runs(tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", str(ROOT / "examples" / "reduce_model.py")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "dc gain 0.111111" in done.stdout
    assert not list(tmp_path.iterdir()), "an example leaves nothing behind"


def test_outputs_fitted_alone_are_brought_to_their_common_poles():
    """Four poles of two fits at 2 % noise: two Hankel values stand out, the common model is the truth."""
    truth = mf.tf([[[1, 2]], [[3]]], [1, 0.8, 4])
    rec = mf.simulate(truth, input="sin(t**2/5)", duration=20.0, intervals=1000, nsr=0.02, seed=0)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1, denominator="separate"))
    assert mf.common_poles(fit).p_value > 0.01
    red = mf.reduce(fit, mf.TransferFunction(poles=2, zeros=1, denominator="common"))
    assert red.hankel[2] < 1e-3 * red.hankel[0]
    assert red.model.den == pytest.approx([1, 0.8, 4], rel=0.01)
    assert red.errors["h2_relative"][0] < 2e-3


def test_three_light_pairs_above_two_hundred_real_poles(monkeypatch):
    """Penzl's example with fewer real poles, 206 states to 10: both norms well below balanced truncation."""
    monkeypatch.syspath_prepend(str(ROOT / "benches"))
    import reduction as bench

    given = bench.penzl()
    h2 = mf.reduce(given, 10).errors["h2"]
    assert h2[0] < 0.85 * h2[1]
    hinf = mf.reduce(given, 10, weight="flat").errors["hinf"]
    assert hinf[0] < 0.6 * hinf[1]


def test_paths_that_are_not_there_and_systems_of_nothing():
    system = mf.tf([[[1], [1, 2]]], np.poly([-1, -2, -3]))
    red = mf.reduce(system, mf.TransferFunction(poles=2, zeros=[0, None]))
    assert not np.any(red.model.num[0][1])
    nothing = mf.reduce(mf.ss(-np.eye(3), np.zeros(3), np.ones(3)), 1)
    assert nothing.h2_error == 0
    with pytest.raises(mf.SpecError, match="a system of 0 states"):
        mf.reduce(mf.tf([2], [1]), 1)
    with pytest.raises(mf.SpecError, match="3 of them not stable and kept"):
        mf.reduce(mf.tf([1], np.polymul([1, -1], [1, -2, 0])), 2)


def test_any_unit_of_time_and_gain():
    """Far beyond the fastest pole the response is rounding, which no grid can settle."""
    poles = np.array([-1, -2, -3, -4 + 1j, -4 - 1j])
    one = mf.reduce(mf.tf([1], np.poly(poles)), 2)
    other = mf.reduce(mf.tf([1e30], np.poly(1e6 * poles)), 2)
    assert other.errors["h2_relative"] == pytest.approx(one.errors["h2_relative"], rel=1e-6)


def test_a_feedthrough_has_no_h2_norm_to_compare_with():
    red = mf.reduce(mf.tf([1, 1, 1], [1, 3, 2]), 1)
    assert 0.1 < red.h2_error < 0.15
    assert np.isnan(red.errors["h2_relative"][0])
    assert 0.1 < red.errors["hinf_relative"][0] < 0.3
