"""Flight and laboratory records, fitted from their files by the command line.

The records are not part of the project: MODFUN_DATA names their folder, else it is ../shared/data beside
the repository.
"""

import json
import warnings

import modfun as mf
import numpy as np
import pytest

pytest.importorskip("typer")
from modfun.commands.main import main
from places import measured


@pytest.fixture
def command(tmp_path, capsys):
    """Run `modfun fit` and load what it saved; also what it wrote to standard error."""

    def run(path, output, inputs, *words):
        saved = tmp_path / "fit.json"
        names = [word for name in inputs for word in ("--input", name)]
        code = main(
            ["fit", str(path), "--output", output, *names, "--time", "t_s", "--json", str(saved), *words]
        )
        assert code == 0
        return mf.load(saved), capsys.readouterr().err

    return run


def test_twin_otter_predicts_another_manoeuvre(command):
    """Elevator to pitch rate: right because it predicts run 019, which it never saw.

    A published transfer function reaches R2 = .992 on run 018 and predicts 019 with .999.
    """
    path, other = (
        measured("twinotter_lon_018/twinotter_lon_018.csv"),
        measured("twinotter_lon_019/twinotter_lon_019.csv"),
    )
    fit, _ = command(path, "q_dps", ["el_deg"], "--poles", "2", "--zeros", "1")
    first = mf.read(path, time="t_s", outputs=["q_dps"], inputs=["el_deg"])
    second = mf.read(other, time="t_s", outputs=["q_dps"], inputs=["el_deg"])
    assert fit.lines == ((1, 19),)
    own, predicted = fit.score(first), fit.score(second)
    assert own["signal_to_error"][0] == pytest.approx(28.3, abs=0.3)
    assert own["r2"][0] > 0.998
    assert predicted["signal_to_error"][0] == pytest.approx(30.6, abs=0.5)
    assert predicted["r2"][0] > 0.999
    # The short period: both manoeuvres alone give the same mode within their errors.
    mode = fit.damp().rows[0]
    assert mode["omega"] == pytest.approx(4.15, abs=0.05)
    assert mode["zeta"] == pytest.approx(0.60, abs=0.02)
    alone = mf.fit(second, fit.structure)
    assert np.median(alone.bse / np.sqrt(np.diag(alone.cov_nonrobust))) > 1.3
    assert np.all(np.abs(alone.params - fit.params) < 2 * np.hypot(alone.bse, fit.bse))
    # Filtered records: the high band is nearly silent, and the check says so instead of condemning the model.
    assert fit.high_band_sigma < 0.02 * fit.sigma
    assert "low-pass filtered" in fit.check()


def test_twin_otter_runs_as_one_problem():
    path, other = (
        measured("twinotter_lon_018/twinotter_lon_018.csv"),
        measured("twinotter_lon_019/twinotter_lon_019.csv"),
    )
    read = [mf.read(p, time="t_s", outputs=["q_dps"], inputs=["el_deg"]) for p in (path, other)]
    with pytest.warns(mf.ModfunWarning, match='slow drift .* First try trend="linear"'):
        level = mf.fit(read, mf.TransferFunction(poles=2, zeros=1))
    fit = mf.fit(read, level.structure, trend="linear")
    assert np.all(fit.bse < 0.7 * level.bse)
    single = mf.fit(read[0], fit.structure, trend="linear")
    assert np.all(fit.bse < single.bse)
    assert np.all(fit.score()["signal_to_error"] > 28)


def test_tu144_needs_its_delay(command):
    """Stick to pitch rate, a low-order equivalent system whose delay stands for the control system.

    Right because cost and simulation are best at one delay inside the range tried.
    """
    path = measured("tu144_lon_4d/tu144_f20_4d.csv")
    found = {}
    for delay in ("0.2", "0.28", "0.36"):
        found[delay], _ = command(
            path, "q_dps", ["lonstk_in"], "--poles", "2", "--zeros", "1", "--delay", delay
        )
    rec = mf.read(path, time="t_s", outputs=["q_dps"], inputs=["lonstk_in"])
    fit = found["0.28"]
    assert fit.cost < min(found["0.2"].cost, found["0.36"].cost)
    assert fit.score(rec)["signal_to_error"][0] == pytest.approx(20.3, abs=0.3)
    mode = fit.damp().rows[0]
    assert mode["omega"] == pytest.approx(2.55, abs=0.1)
    assert mode["zeta"] == pytest.approx(0.78, abs=0.05)
    assert found["0.2"].lines == ((1, 23),)


def test_f18_high_alpha(command):
    """Stabilator to pitch rate between 15 and 23 degrees: slow, lightly damped, poorly known damping.

    Right because it does not depend on the band (4 to 10 rad/s), and its errors say what is not known:
    HC3 ones are several times larger.
    """
    path = measured("f18harv_lon_153b/f18harv_153b.csv")
    fit, _ = command(path, "q_dps", ["stab_deg"], "--poles", "2", "--zeros", "1")
    rec = mf.read(path, time="t_s", outputs=["q_dps"], inputs=["stab_deg"])
    assert fit.lines == ((1, 11),)
    assert np.median(fit.bse / np.sqrt(np.diag(fit.cov_nonrobust))) > 1.3
    assert fit.score(rec)["signal_to_error"][0] == pytest.approx(23.06, abs=0.2)
    assert fit["b0"] == pytest.approx(-1.42, abs=0.03)
    mode = fit.damp().rows[0]
    assert mode["omega"] == pytest.approx(0.68, abs=0.02)
    for band in ("4", "8"):
        other, _ = command(path, "q_dps", ["stab_deg"], "--poles", "2", "--zeros", "1", "--band", band)
        assert np.all(np.abs(other.params - fit.params) < 0.2 * fit.bse)


def test_supersonic_transport_finds_the_truth(tmp_path, command):
    """Simulated, truth (0.4 s + 0.1) exp(-0.2 s)/(s^2 + 0.9 s + 2), input straight between samples."""
    path = measured("sst_pitch_tf_delay/sst_pitch.csv")
    words = ["--poles", "2", "--zeros", "1", "--delay", "0.2", "--intersample", "foh"]
    truth = np.array([0.9, 2.0, 0.4, 0.1])
    clean, _ = command(path, "ytrue_q_dps", ["u_stick_cm"], *words)
    # The file's own simulation error is 2.4e-4 of standard deviation, 62 dB below the output.
    np.testing.assert_allclose(clean.params, truth, rtol=1.5e-3)
    rec = mf.read(path, time="t_s", outputs=["ytrue_q_dps"], inputs=["u_stick_cm"], intersample="foh")
    assert clean.score(rec)["signal_to_error"][0] > 60

    level = 0.1 * rec.y.std()
    noisy = rec.y[0] + level * np.random.default_rng(7).standard_normal(rec.t.size)
    copy = tmp_path / "noisy.csv"
    np.savetxt(
        copy,
        np.column_stack([rec.t, noisy, rec.u[0]]),
        delimiter=",",
        header="t_s,q,u",
        comments="",
        fmt="%.17g",
    )
    fit, said = command(copy, "q", ["u"], *words)
    assert np.all(np.abs(fit.params - truth) < 3 * fit.bse)
    assert np.all(fit.bse < [0.005, 0.006, 0.002, 0.002])
    assert fit.sigma == pytest.approx(level, rel=0.1)
    assert fit.high_band_sigma == pytest.approx(level, rel=0.05)
    noisy_rec = mf.read(copy, time="t_s", outputs=["q"], inputs=["u"], intersample="foh")
    assert fit.score(noisy_rec)["signal_to_error"][0] == pytest.approx(20.0, abs=0.3)  # the noise's own level
    assert said.count("warning") == 0
    assert not mf.fit(noisy_rec, fit.structure).check()


def test_supersonic_transport_measured_column_has_coloured_noise():
    """Column z: noise with a lag-1 correlation of .93 and the system's own resonance."""
    path = measured("sst_pitch_tf_delay/sst_pitch.csv")
    rec = mf.read(path, time="t_s", outputs=["z_q_dps"], inputs=["u_stick_cm"], intersample="foh")
    with pytest.warns(mf.ModfunWarning, match='First try that input, or noise="coloured", band='):
        fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1, delay=0.2), band=6.0)
    assert "classical ones do not" in fit.check()


def test_hair_dryer_has_a_delay_and_two_minima(command):
    """Heater to air temperature, the input held over 0.08 s.

    Ljung's discrete models find about three samples from input to output, one of which is the hold: .16
    to .24 s. Right because the best of the delays 0, .08, ... lies there.
    """
    path = measured("daisy_hairdryer/hairdryer.csv")
    two = ["--poles", "2", "--zeros", "0", "--intersample", "zoh"]
    delays = ("0", "0.08", "0.16", "0.24")
    found = [command(path, "y_temp", ["u_heating"], *two, "--delay", delay)[0] for delay in delays]
    rec = mf.read(path, time="t_s", outputs=["y_temp"], inputs=["u_heating"], intersample="zoh")
    levels = [fit.score(rec)["signal_to_error"][0] for fit in found]
    assert int(np.argmax(levels)) == 2
    assert levels[2] == pytest.approx(18.94, abs=0.2)
    assert found[2].model.dcgain() == pytest.approx(0.94, abs=0.01)

    one = ["--poles", "2", "--zeros", "1", "--delay", "0.24", "--intersample", "smooth"]
    fit, _ = command(path, "y_temp", ["u_heating"], *one)
    rule = fit.band_rule
    assert min(rule["cost_wide"], rule["cost_narrow"]) == pytest.approx(8.08, rel=0.02)
    assert max(rule["cost_wide"], rule["cost_narrow"]) == pytest.approx(11.77, rel=0.02)
    smooth = mf.read(path, time="t_s", outputs=["y_temp"], inputs=["u_heating"], intersample="smooth")
    assert fit.score(smooth)["signal_to_error"][0] == pytest.approx(18.6, abs=0.3)
    assert "Two minima" in fit.check()
    assert json.loads(json.dumps(fit.to_dict()))["band_rule"]["cost_wide"] == rule["cost_wide"]


def test_twinotter_lateral_outputs_share_their_poles():
    """Sideslip, roll and yaw rate from aileron and rudder with one denominator of four poles.

    Right because a lightly damped Dutch roll of about 2 rad/s, a roll mode of
    some tenths of a second and a slow spiral come out, and every channel is simulated to over 30 dB.
    """
    path = measured("twinotter_lat_f1_017/twinotter_lat_f1_017.csv")
    outputs = ["beta_deg", "p_dps", "r_dps"]
    rec = mf.read(path, time="t_s", outputs=outputs, inputs=["ail_deg", "rdr_deg"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)  # real noise: classical errors differ from HC3
        fit = mf.fit(rec, mf.TransferFunction(poles=4, denominator="common"))
    assert fit.success
    assert (fit.score()["signal_to_error"] > 30).all()
    spiral, dutch, roll = fit.damp().rows
    assert dutch["omega"] == pytest.approx(2.04, abs=0.1)
    assert dutch["zeta"] == pytest.approx(0.30, abs=0.05)
    assert 0.1 < roll["time_constant"] < 0.3
    assert spiral["time_constant"] > 2


def test_tu144_delay_is_estimated():
    """The delay of the low-order equivalent system, .28 s by hand, estimated with its error."""
    path = measured("tu144_lon_4d/tu144_f20_4d.csv")
    rec = mf.read(path, time="t_s", outputs=["q_dps"], inputs=["lonstk_in"])
    late = mf.TransferFunction(poles=2, zeros=1, delay=mf.Free(max=0.6))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        fit = mf.fit(rec, late)
    assert abs(fit["delay"] - 0.28) < 2 * fit.bse[-1]
    assert fit.bse[-1] < 0.03
    assert fit.score()["r2"][0] > 0.99
