"""The command: what it prints where, and its exit codes."""

import json
import subprocess
import sys

import modfun as mf
import numpy as np
import pytest

pytest.importorskip("typer")
from modfun.commands.main import in_options, main


@pytest.fixture
def table(tmp_path):
    t = np.linspace(0.0, 10.0, 257)
    u = np.sin(t**2 / 5)
    y = mf.tf([5], [1, 3, 8]).simulate(u="sin(t**2/5)", dt=10 / 256, intervals=256, initial_state=[1, 0.5])
    y += 2 + 0.02 * np.random.default_rng(0).standard_normal(t.size)
    path = tmp_path / "run.csv"
    np.savetxt(path, np.column_stack([t, y, u]), delimiter=",", header="t_s,q,de", comments="", fmt="%.17g")
    return path


FIT = ["--output", "q", "--input", "de", "--poles", "2", "--zeros", "0"]


def test_fit_prints_the_summary_and_nothing_else(table, capsys):
    assert main(["fit", str(table), *FIT]) == 0
    out, err = capsys.readouterr()
    rec = mf.read(table, outputs=["q"], inputs=["de"])
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    assert str(fit.summary()) in out
    assert "signal_to_error" in out
    assert err == ""


def test_json_goes_to_standard_output_or_to_a_file_that_loads(table, tmp_path, capsys):
    assert main(["fit", str(table), *FIT, "--json", "-"]) == 0
    printed = json.loads(capsys.readouterr().out)
    path = tmp_path / "fit.json"
    assert main(["fit", str(table), *FIT, "--json", str(path)]) == 0
    assert "wrote" in capsys.readouterr().err
    fit = mf.load(path)
    assert fit.params.tolist() == printed["params"]
    rec = mf.read(table, outputs=["q"], inputs=["de"])
    assert fit.params.tolist() == mf.fit(rec, mf.TransferFunction(poles=2, zeros=0)).params.tolist()


def test_a_sample_to_try_the_commands_on(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["sample"]) == 0
    assert "modfun check flight.csv" in capsys.readouterr().err
    assert main(["fit", "flight.csv", "-y", "q", "-u", "de", "--intersample", "zoh", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    # four standard errors of four parameters: false alarm below 1 in 1,000, and the seed is fixed
    fit = mf.fit(mf.read("flight.csv", outputs="q", inputs="de", intersample="zoh"),
                 mf.TransferFunction(poles=2))  # fmt: skip
    assert found["params"] == fit.params.tolist()
    assert (abs(fit.params - [1.8, 5.0, -4.0, -3.0]) < 4 * fit.bse).all()
    assert main(["sample"]) == 2
    assert "flight.csv is there already" in capsys.readouterr().err


def test_a_wrong_column_gets_the_nearest_names(table, capsys):
    assert main(["fit", str(table), "--output", "Qq", "--input", "de"]) == 2
    assert "run.csv has no column 'Qq'; did you mean 'q'? there are: t_s, q, de" in capsys.readouterr().err
    assert main(["fit", str(table), "--output", "q", "--input", "del"]) == 2
    assert "no column 'del'; did you mean 'de'?" in capsys.readouterr().err


def test_an_exported_iddata_from_the_shell(table, tmp_path, capsys):
    from scipy.io import savemat

    rec = mf.read(table, outputs=["q"], inputs=["de"])
    one = {"OutputData": rec.y.T, "InputData": rec.u.T, "Ts": rec.dt, "InterSample": "bl"}
    savemat(tmp_path / "run.mat", {"z1": one, "z2": one})
    words = ["--output", "y", "--poles", "2", "--zeros", "0"]
    assert main(["fit", str(tmp_path / "run.mat"), *words]) == 2
    assert "choose one with --part: z1, z2" in capsys.readouterr().err
    assert main(["fit", str(tmp_path / "run.mat"), *words, "--part", "z1", "--json", "-"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["params"] == mf.fit(rec, mf.TransferFunction(poles=2, zeros=0)).params.tolist()
    assert main(["check", str(tmp_path / "run.mat"), "--part", "z2"]) == 0
    out = capsys.readouterr().out
    assert "input, smooth" in out
    assert "Record of 10 s" in out


def test_options_reach_the_fit(table, capsys):
    words = [
        "--band",
        "0.5:8",
        "--method",
        "awls",
        "--trend",
        "linear",
        "--delay",
        "0.05",
        "--intersample",
        "foh",
    ]
    assert (
        main(
            ["fit", str(table), *FIT, *words, "--rule", "trapezoid", "--cov-type", "nonrobust", "--json", "-"]
        )
        == 0
    )
    found = json.loads(capsys.readouterr().out)
    options = found["options"]
    assert options["band"] == [0.5, 8.0]
    assert (options["method"], options["trend"], options["rule"]) == ("awls", "linear", "trapezoid")
    assert options["cov_type"] == "nonrobust"
    assert found["structure"]["delay"] == 0.05
    assert found["intersample"] == ["foh"]
    assert main(["fit", str(table), *FIT, "--trend", "none", "--harmonics", "6", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["options"]["trend"] is None


@pytest.fixture
def two(tmp_path):
    """Two outputs, two inputs and a delay of the second, as a file."""
    t = np.linspace(0.0, 20.0, 401)
    u = np.array([np.sin(t**2 / 6), np.cos((20 - t) ** 2 / 5)])
    sys = mf.tf([[[1.0, 2.0], [3.0]], [[0.5], [-1.0, 0.7]]], [1, 1.2, 4.0], delay=[0, 0.2])
    y = sys.simulate(u=u, dt=0.05) + 0.02 * np.random.default_rng(0).standard_normal((2, t.size))
    path = tmp_path / "two.csv"
    columns = np.column_stack([t, *y, *u])
    np.savetxt(path, columns, delimiter=",", header="t_s,al,q,de,da", comments="", fmt="%.17g")
    return path


TWO = ["--output", "al", "--output", "q", "--input", "de", "--input", "da"]


@pytest.mark.parametrize("denominator", ["common", "separate"])
def test_several_outputs(denominator, two, tmp_path, capsys):
    words = ["--zeros", "1,0", "--zeros", "0,1", "--delay", "0", "--delay", "0.1:0:0.5"]
    words = ["fit", str(two), *TWO, "--denominator", denominator, *words, "--band", "6"]
    saved, picture = tmp_path / "fit.json", tmp_path / "fit.png"
    pytest.importorskip("matplotlib")
    assert main([*words, "--json", str(saved), "--plot", str(picture)]) == 0
    out, _ = capsys.readouterr()
    rec = mf.read(two, outputs=["al", "q"], inputs=["de", "da"])
    late = [0.0, mf.Free(0.1, min=0, max=0.5)]
    tf = mf.TransferFunction(poles=2, zeros=[[1, 0], [0, 1]], denominator=denominator, delay=late)
    fit = mf.fit(rec, tf, band=6.0)
    assert str(fit.summary()) in out
    assert str(fit.score()) in out
    back = mf.load(saved)
    assert back.structure == tf
    assert back.params.tolist() == fit.params.tolist()
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["compare", str(saved), str(two), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["output"] == ["al", "q"]


def test_one_number_of_poles_and_zeros_an_output(two, capsys):
    words = [
        "--output",
        "al",
        "--output",
        "q",
        "--input",
        "de",
        "--denominator",
        "separate",
        "--noise",
        "coloured",
    ]
    assert main(
        [
            "fit",
            str(two),
            *words,
            "--poles",
            "2",
            "--poles",
            "3",
            "--zeros",
            "1",
            "--zeros",
            "0",
            "--json",
            "-",
        ]
    ) in (0, 1)
    found = json.loads(capsys.readouterr().out)
    assert found["structure"]["poles"] == [2, 3]
    assert found["structure"]["zeros"] == [[1], [0]]
    assert found["options"]["noise"] == "coloured"


def test_parameters_are_held_and_bounded(table, capsys):
    words = ["--param", "a2=8", "--param", "a1=2.5:0:", "--band", "8", "--json", "-"]
    assert main(["fit", str(table), *FIT, *words]) == 0
    printed = json.loads(capsys.readouterr().out)
    params = {"a2": 8.0, "a1": mf.Free(2.5, min=0)}
    rec = mf.read(table, outputs=["q"], inputs=["de"])
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0, params=params), band=8.0)
    assert fit.param_names == ("a1", "b0")
    assert printed["params"] == fit.params.tolist()


def test_parameters_and_states_are_known_beforehand(table, capsys):
    known = ["--param", "a1=2.5+-0.2", "--band", "8", "--json", "-"]
    assert main(["fit", str(table), *FIT, *known]) == 0
    printed = json.loads(capsys.readouterr().out)
    rec = mf.read(table, outputs=["q"], inputs=["de"])
    told = mf.TransferFunction(poles=2, zeros=0, params={"a1": mf.Free(2.5, sd=0.2)})
    assert printed["params"] == mf.fit(rec, told, band=8.0).params.tolist()
    state = ["--initial-state", "1,0.5", "--band", "8", "--json", "-"]
    assert main(["fit", str(table), *FIT, *state]) == 0
    printed = json.loads(capsys.readouterr().out)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), band=8.0, initial_state=[1.0, 0.5])
    assert printed["params"] == fit.params.tolist()


def test_several_files_are_one_problem(table, capsys):
    assert main(["fit", str(table), str(table), *FIT, "--json", "-"]) == 0
    assert len(json.loads(capsys.readouterr().out)["lines"]) == 2


def test_a_picture_is_drawn(table, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    path = tmp_path / "fit.png"
    assert main(["fit", str(table), *FIT, "--plot", str(path)]) == 0
    assert path.read_bytes().startswith(b"\x89PNG")
    assert main(["fit", str(table), *FIT, "--plot", str(tmp_path / "fit.xyz")]) == 2
    assert ".png" in capsys.readouterr().err


def test_orders_are_compared(table, tmp_path, capsys):
    words = ["order", str(table), "--output", "q", "--input", "de", "--poles", "1:3", "--band", "12"]
    assert main(words) == 0
    out, err = capsys.readouterr()
    rec = mf.read(table, outputs=["q"], inputs=["de"])
    found = mf.select_order(rec, poles=range(1, 4), band=12.0)
    assert str(found) in out
    assert err == ""
    assert main([*words, "--zeros", "0", "--zeros", "1", "--json", "-"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["table"]["zeros"] == [0, 1, 0, 1, 0, 1]
    assert printed["best"]["params"] == found.best.params.tolist()
    pytest.importorskip("matplotlib")
    assert main([*words, "--plot", str(tmp_path / "order.png")]) == 0
    assert (tmp_path / "order.png").read_bytes().startswith(b"\x89PNG")


def test_terms_are_selected(tmp_path, capsys):
    spring = mf.Equation("y'' + 0.3*y' + y + 0.5*y**3 = u")
    rec = mf.simulate(
        spring.model({}), input="2*sin(1.1*t) + 1.5*sin(2.3*t)", duration=20.0, intervals=512, nsr=0.05
    )
    rec.to_csv(tmp_path / "spring.csv")
    words = ["terms", str(tmp_path / "spring.csv"), "--output", "y", "--input", "u", "--target", "y''"]
    library = ["--library", "y, y**2, y**3, y', u", "--keep", "u", "--sign", "y**3=-", "--hierarchy"]
    assert main([*words, *library, "--json", "-"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert sorted(printed["terms"]["y''"]) == ["u", "y", "y'", "y**3"]
    assert main([*words, *library]) == 0
    assert "Probability" in capsys.readouterr().out
    assert main(words) == 2
    assert "--library" in capsys.readouterr().err
    noise = np.random.default_rng(0).standard_normal((2, 200))
    mf.Record(y=noise[0], u=noise[1], dt=0.05, intersample="smooth").to_csv(tmp_path / "noise.csv")
    assert main(["terms", str(tmp_path / "noise.csv"), "--output", "y", "--library", "y**3"]) == 1
    assert "nothing is chosen; give others" in capsys.readouterr().err


def test_fits_are_compared_on_a_record(table, tmp_path, capsys):
    one, two = tmp_path / "one.json", tmp_path / "two.json"
    assert main(["fit", str(table), *FIT, "--json", str(two)]) == 0
    assert main(["fit", str(table), *FIT[:4], "--poles", "1", "--zeros", "0", "--json", str(one)]) == 0
    capsys.readouterr()
    assert main(["compare", str(one), str(two), str(table)]) == 0
    out, _ = capsys.readouterr()
    rec = mf.read(table, outputs=["q"], inputs=["de"])
    expected = mf.compare({str(one): mf.load(one), str(two): mf.load(two)}, rec)
    assert str(expected) in out
    assert main(["compare", str(two), str(table), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["fit_percent"] == [expected["fit_percent"][1]]
    pytest.importorskip("matplotlib")
    assert main(["compare", str(two), str(table), "--plot", str(tmp_path / "both.svg")]) == 0
    assert "<svg" in (tmp_path / "both.svg").read_text()


def test_warnings_go_to_standard_error(table, capsys):
    assert main(["fit", str(table), "--output", "q", "--input", "de", "--poles", "1", "--zeros", "0"]) == 0
    out, err = capsys.readouterr()
    assert "modfun: warning: fit: The residuals of q follow de" in err
    assert "modfun: warning" not in out


def test_a_failed_fit_is_exit_code_1(tmp_path, capsys):
    t = np.linspace(0, 10, 201)
    path = tmp_path / "twins.csv"
    columns = np.column_stack([t, np.sin(t), np.sin(t**2 / 5), 2 * np.sin(t**2 / 5)])
    np.savetxt(path, columns, delimiter=",", header="t_s,q,de,da", comments="", fmt="%.17g")
    words = ["--output", "q", "--input", "de", "--input", "da", "--zeros", "0", "--band", "6"]
    assert main(["fit", str(path), *words]) == 1
    out, err = capsys.readouterr()
    assert "cannot tell the parameters apart" in out
    assert "cannot tell the parameters apart" in err


def test_check_shows_columns_and_findings(table, capsys):
    lines = table.read_text().splitlines()
    lines[101] = ",".join([lines[101].split(",")[0], "1e3", lines[101].split(",")[2]])
    table.write_text("\n".join(lines))
    assert main(["check", str(table), "--output", "q", "--input", "de", "--json", "-"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["columns"]["column"] == ["t_s", "q", "de"]
    assert any("Output 'q' has 1 outlying sample" in text for text in found["findings"])
    assert main(["check", str(table)]) == 0
    out = capsys.readouterr().out
    assert "de" in out
    assert out.endswith(f"modfun check {table} --output q --input de\n")


BAD = {
    "no such file": (["fit", "nowhere.csv", *FIT], "nowhere.csv"),
    "no output": (["fit", "TABLE", "--input", "de"], "--output"),
    "two outputs": (["fit", "TABLE", "--output", "q", "--output", "de"], "--denominator common or separate"),
    "second output unknown": (["fit", "TABLE", *FIT[:2], "--output", "dee"], "did you mean 'de'?"),
    "rows of the wrong length": (["fit", "TABLE", *FIT[:4], "--zeros", "1,0"], "1 output(s) and 1 input(s)"),
    "unknown denominator": (["fit", "TABLE", *FIT, "--denominator", "shared"], "common, separate"),
    "unknown noise": (["fit", "TABLE", *FIT, "--noise", "colored"], "'coloured'"),
    "unknown parameter": (["fit", "TABLE", *FIT, "--param", "a3=0"], "did you mean"),
    "parameter without a value": (["fit", "TABLE", *FIT, "--param", "a2"], "NAME=VALUE"),
    "parameter in words": (["fit", "TABLE", *FIT, "--param", "a2=nought"], "start:]min:max"),
    "four bounds": (["fit", "TABLE", *FIT, "--param", "a2=0:1:2:3"], "start:]min:max"),
    "mean in words": (["fit", "TABLE", *FIT, "--param", "a2=about+-1"], "mean+-sd"),
    "bounds crossed": (["fit", "TABLE", *FIT, "--param", "a2=2:1"], "must lie below"),
    "delay without its most": (["fit", "TABLE", *FIT, "--delay", "0.1:0:"], "needs its most"),
    "unknown column": (["fit", "TABLE", "--output", "qq", "--input", "de"], "'q'"),
    "unknown method": (["fit", "TABLE", *FIT, "--method", "mll"], "'ml'"),
    "band of words": (["fit", "TABLE", *FIT, "--band", "low:high"], "0.5:8"),
    "band of three": (["fit", "TABLE", *FIT, "--band", "1:2:3"], "0.5:8"),
    "band upside down": (["fit", "TABLE", *FIT, "--band", "8:1"], "lower < upper"),
    "zeros in words": (["fit", "TABLE", "--output", "q", "--input", "de", "--zeros", "two"], "whole number"),
    "more zeros than poles": (["fit", "TABLE", "--output", "q", "--input", "de", "--zeros", "5"], "poles"),
    "negative delay": (["fit", "TABLE", *FIT, "--delay", "-1"], "at least 0"),
    "unknown option": (["fit", "TABLE", *FIT, "--bnd", "8"], "--band"),
    "unknown command": (["fitt"], "fit"),
    "text where a number goes": (["fit", "TABLE", *FIT, "--poles", "two"], "--poles"),
    "json into no folder": (["fit", "TABLE", *FIT, "--json", "/nowhere/fit.json"], "/nowhere/fit.json"),
    "check of nothing": (["check"], "FILE"),
    "order without an output": (["order", "TABLE", "--input", "de"], "--output"),
    "order of words": (["order", "TABLE", *FIT[:4], "--poles", "few"], "1:5"),
    "order by ls": (["order", "TABLE", *FIT[:4], "--method", "ls"], "awls"),
    "comparison of nothing": (["compare", "TABLE"], "modfun fit --json"),
    "comparison with no fit": (["compare", "TABLE", "TABLE"], "load"),
    "intersample": (["fit", "TABLE", *FIT, "--intersample", "hold"], "smooth"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_use_is_exit_code_2_with_one_sentence(case, table, capsys):
    words, cure = BAD[case]
    assert main([str(table) if word == "TABLE" else word for word in words]) == 2
    err = capsys.readouterr().err
    assert cure in err
    assert "Traceback" not in err


def test_version_and_help(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == f"modfun {mf.__version__}"
    assert main(["fit", "--help"]) == 0
    assert "--intersample" in capsys.readouterr().out


@pytest.mark.process
def test_as_a_module(table):
    run = subprocess.run(
        [sys.executable, "-m", "modfun", "fit", str(table), *FIT, "--json", "-"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(run.stdout)["status"] == "ok"
    bad = subprocess.run(
        [sys.executable, "-m", "modfun", "fit", "nowhere.csv", *FIT], capture_output=True, text=True
    )
    assert bad.returncode == 2
    assert bad.stderr.startswith("modfun: ")


@pytest.mark.process
def test_a_closed_pipe_loses_no_report(table, tmp_path):
    page = tmp_path / "fit.html"
    words = [sys.executable, "-m", "modfun", "fit", str(table), *FIT, "--report", str(page)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as run:
        assert run.stdout is not None
        run.stdout.close()
    assert "<html" in page.read_text(encoding="utf-8")


def test_without_typer_one_sentence_names_the_extra(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "typer", None)
    assert main(["--version"]) == 2
    assert 'pip install "modfun[cli]"' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("said", "here"),
    [
        ("give time='t' or dt=0.1, not both", "give --time t or --dt 0.1, not both"),
        ("say with outputs= which; name it with time=.", "say with --output which; name it with --time."),
        ('First try initial_state="unknown".', "First try --initial-state unknown."),
        ("take rec.select(outputs=['y'])", "take rec.select(outputs=['y'])"),
        ("leave it out, or weight all, robust=True.", "leave it out, or weight all, --robust."),
        ("fit: reference='r', but record 0 keeps none", "fit: --reference r, but record 0 keeps none"),
    ],
)
def test_messages_are_in_the_words_of_the_command_line(said, here):
    assert in_options(said) == here


def test_columns_are_listed(table, capsys):
    assert main(["columns", str(table)]) == 0
    assert str(mf.columns(table)) in capsys.readouterr().out
    assert main(["columns", str(table), "--json", "-"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["columns"]["column"] == ["t_s", "q", "de"]


def params(capsys):
    return json.loads(capsys.readouterr().out)["params"]


def test_windows_names_and_units_of_what_is_read(table, capsys):
    words = ["--output", "rate=q", "--input", "ele=de", "--units", "rate=deg/s", "--convert", "rate=rad/s"]
    more = ["--window", ":8", "--poles", "2", "--zeros", "0", "--json", "-"]
    assert main(["fit", str(table), *words, *more]) == 0
    rec = mf.read(table, outputs={"rate": "q"}, inputs={"ele": "de"}, units={"rate": "deg/s"})
    rec = rec.window(0, 8).convert(rate="rad/s")
    assert params(capsys) == mf.fit(rec, mf.TransferFunction(poles=2, zeros=0)).params.tolist()


def test_inputs_are_known_at_all_times(table, capsys):
    """In place of a column, or, of another name, beside them."""
    model, text = mf.TransferFunction(poles=2, zeros=0), "sin(t**2/5)"
    rec = mf.read(table, outputs="q", inputs="de").assign(de=text)
    more = ["--poles", "2", "--zeros", "0", "--json", "-"]
    assert main(["fit", str(table), "-y", "q", "-u", "de", "--assign", f"de={text}", *more]) == 0
    found = params(capsys)
    assert found == mf.fit(rec, model).params.tolist()
    alone = ["--assign", f"stick={text}", *more]
    assert main(["fit", str(table), "-y", "q", *alone]) == 0
    np.testing.assert_allclose(params(capsys), found, rtol=1e-9)
    assert main(["fit", str(table), "-y", "q", "-u", "de", "--assign", "de", *more]) == 2
    assert "--assign de: give NAME=TEXT, such as de=sin(t**2/5)" in capsys.readouterr().err
    assert main(["fit", str(table), "-y", "q", "-u", "de", "--assign", "q=sin(t)", *more]) == 2
    assert "--assign q: it is no input" in capsys.readouterr().err


def test_equations_and_state_spaces_are_fitted_from_text(table, tmp_path, capsys):
    rec = mf.read(table, outputs="q", inputs="de")
    text = "q'' + d*q' + k*q = b*de + c"
    path = tmp_path / "fit.json"
    assert main(["fit", str(table), "-y", "q", "-u", "de", "--equation", text, "--json", str(path)]) == 0
    wanted = mf.fit(rec, mf.Equation(text, outputs=["q"], inputs=["de"]))
    assert mf.load(path).params.tolist() == wanted.params.tolist()
    capsys.readouterr()
    assert main(["compare", str(path), str(table), "-y", "q=q", "--window", "5:"]) == 0
    assert str(wanted.score(rec.window(5, 10))["fit_percent"][0])[:5] in capsys.readouterr().out
    words = ["--A", "0 1; -k -d", "--B", "0; b", "--C", "1 0", "--states", "x,v", "--param", "k=8"]
    assert main(["fit", str(table), "-y", "q", "-u", "de", *words, "--json", "-"]) == 0
    model = mf.StateSpace(
        [[0, 1], ["-k", "-d"]], [[0], ["b"]], [[1, 0]], states=["x", "v"], inputs=["de"], outputs=["q"],
        params={"k": 8.0},
    )  # fmt: skip
    assert params(capsys) == mf.fit(rec, model).params.tolist()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--A", "a", "--poles", "2"], "--A beside --poles, --zeros and --denominator"),
        (["--A", "a", "--B", "b", "--delay", "0:0.3"], "as --delay h --param h=0:0.3"),
        (["--B", "b"], "--B without --A; give the matrix of the states as well"),
        (["--window", "3"], "--window 3: give FROM:TO in s, such as 2:10"),
        (["--units", "q"], "--units q: give NAME=UNIT, such as q=deg/s"),
        (["--output", "q=q"], "q=q: give each column once"),
        (["--equation", "q' + = 3"], "equation"),
    ],
)
def test_what_does_not_go_together_is_refused(table, capsys, words, said):
    assert main(["fit", str(table), "--output", "q", "--input", "de", *words]) == 2
    assert said in capsys.readouterr().err


def test_robust_and_stable_fits(tmp_path, capsys):
    rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    noise = 0.02 * np.random.default_rng(0).standard_t(2.2, rec.t.size)
    path, model = tmp_path / "run.csv", mf.TransferFunction(poles=2, zeros=0)
    np.savetxt(path, np.column_stack([rec.t, rec["y"] + noise, rec["u"]]), delimiter=",",
               header="t_s,q,de", comments="", fmt="%.17g")  # fmt: skip
    read = mf.read(path, outputs=["q"], inputs=["de"])
    found = {}
    for name in ("robust", "stable"):
        assert main(["fit", str(path), *FIT, f"--{name}", "--json", "-"]) == 0
        found[name] = params(capsys)
    assert found["robust"] == mf.fit(read, model, robust=True).params.tolist()
    assert found["stable"] == mf.fit(read, model, stable=True).params.tolist()
    assert found["robust"] != found["stable"]
    assert main(["fit", str(path), *FIT, "--robust", "--method", "ls"]) == 2
    assert "modfun: fit: --robust weights samples" in capsys.readouterr().err


def test_an_unstable_fit_is_printed_without_a_score(tmp_path, capsys):
    """It ended with 2 and one line about an overflow, as where input and output are swapped."""
    t = 0.02 * np.arange(401)
    u = np.random.default_rng(0).standard_normal(401)
    y = np.zeros(401)
    for k in range(400):
        y[k + 1] = 0.9 * y[k] + 0.1 * u[k]
    path = tmp_path / "run.csv"
    np.savetxt(path, np.column_stack([t, y, u]), delimiter=",", header="t,q,de", comments="")
    swapped = ["-y", "de", "-u", "q", "--poles", "2", "--param", "a1=-200", "--intersample", "smooth"]
    picture = tmp_path / "fit.png"
    assert main(["fit", str(path), *swapped, "--plot", str(picture)]) in (0, 1)
    out, err = capsys.readouterr()
    assert "parameter" in out
    assert "not scored; simulating: the response overflows within 8 s" in out
    assert "fit.png is not drawn; " in err
    assert not picture.exists()


def test_date_and_time_of_two_columns(tmp_path, capsys):
    lines = [f"3/5/2026;11:59:{k:02d} AM;{k % 7}" for k in range(50)]
    (path := tmp_path / "run.csv").write_text("\n".join(["Date;Time;q", *lines]))
    assert main(["check", str(path), "-y", "q", "--time", "Date", "--time", "Time", "--json", "-"]) == 0
    assert "q" in capsys.readouterr().out
