"""`modfun mc`: what it prints where, what it leaves behind, its exit codes."""

from __future__ import annotations

import importlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
import pytest
from study_cases import same, small_parts

pytest.importorskip("typer")
from modfun.base.progress import clock
from modfun.commands.main import main
from modfun.study import run as study_run

STUDY = """
input = "sin(t**2/5)"
duration = 10.0
intervals = 64
nsr = [0.1, 0.4]
estimators = ["ls", "ml"]
harmonics = 6
replicates = 2660
seed = 3

[system.two]
num = [5]
den = [1, 3, 8]

[system.one]
num = [1]
den = [1, 1]
"""
PARTS = 6  # of 512 replicates


def python() -> mf.MonteCarlo:
    """The study of the file."""
    return mf.MonteCarlo(
        system={"two": mf.tf([5], [1, 3, 8]), "one": mf.tf([1], [1, 1])},
        input="sin(t**2/5)",
        duration=10.0,
        intervals=64,
        nsr=[0.1, 0.4],
        estimators=["ls", "ml"],
        harmonics=6,
        replicates=2660,
        seed=3,
    )


@pytest.fixture(autouse=True)
def in_a_folder_with_the_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small_parts(monkeypatch)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    Path("study.toml").write_text(STUDY)


@pytest.fixture(scope="module")
def results() -> mf.Results:
    with pytest.MonkeyPatch.context() as patch:
        small_parts(patch)
        return python().run(progress=False)


def run(*words: str) -> int:
    return main(["mc", *words])


# init and run ------------------------------------------------------------------------------------


def test_init_writes_what_runs_and_never_overwrites(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("init", "new.toml") == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert "modfun mc run new.toml --out runs/new" in err
    assert run("run", "new.toml", "--out", "runs/new", "--replicates", "20") == 0
    assert "eq24" in capsys.readouterr().out
    before = Path("study.toml").read_text()
    assert run("init") == 2
    assert "stays as it is" in capsys.readouterr().err
    assert Path("study.toml").read_text() == before


def test_run_prints_the_table_and_keeps_the_study(
    results: mf.Results, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("run", "study.toml", "--out", "a", "--json", "a.json") == 0
    out, err = capsys.readouterr()
    assert out == f"{results}\n"
    assert err == "modfun: wrote a.json\n"
    kept = mf.load("a")
    assert same(kept, results)
    told = json.loads(Path("a.json").read_text())
    assert told["table"]["bias"] == results.table()["bias"].tolist()
    assert told["replicates"] == 2660
    assert (Path("a") / "study.toml").read_text() == STUDY
    (note,) = map(json.loads, (Path("a") / "runs.jsonl").read_text().splitlines())
    assert (note["modfun"], note["replicates"], note["shard"]) == (mf.__version__, 2660, None)


def test_json_on_standard_output_is_json_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("run", "study.toml", "--out", "a", "--replicates", "100", "--json", "-") == 0
    assert json.loads(capsys.readouterr().out)["replicates"] == 100


def test_more_replicates_in_the_same_directory(
    results: mf.Results, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("run", "study.toml", "--out", "a", "--replicates", "700") == 0
    assert mf.load("a").replicates == 700
    assert run("run", "study.toml", "--out", "a") == 0
    assert same(mf.load("a"), results)


def test_options_reach_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "study.toml", "--out", "a", "--until", "bias=0.3", "--until", "sd=1", "--threads", "1"]
    assert run(*words, "--keep", "samples", "--draw", "coefficients", "--progress") == 0
    assert "ls, ml: " in capsys.readouterr().err
    limits = {"bias": 0.3, "sd": 1.0}
    found = python().run(until=limits, draw="coefficients", progress=False)
    kept = mf.load("a")
    assert kept.samples is not None
    assert kept.replicates == found.replicates
    np.testing.assert_array_equal(kept.bias, found.bias)
    note = json.loads((Path("a") / "runs.jsonl").read_text())
    assert note["until"] == limits


def test_an_estimator_that_never_succeeds_is_exit_code_1(capsys: pytest.CaptureFixture[str]) -> None:
    Path("broken_kit.py").write_text("def never(rec, rng):\n    raise RuntimeError('bad day')\n")
    lines = [line for line in STUDY.splitlines() if not line.startswith(("estimators", "replicates"))]
    text = "\n".join([*lines, "[estimators]", 'ls = "ls"', 'never = "broken_kit:never"'])
    Path("study.toml").write_text("replicates = 5\n" + text)
    assert run("run", "study.toml", "--out", "a") == 1
    out, err = capsys.readouterr()
    assert "never" in out
    assert "RuntimeError: bad day" in err
    assert run("replicate", "a", "3", "--cell", "system=two", "--cell", "nsr=0.1") == 0
    out = capsys.readouterr().out
    assert "failed: RuntimeError: bad day" in out
    assert run("report", "a", "--out", "a.html") == 0
    assert "bad day" in Path("a.html").read_text()


def test_another_study_is_refused_and_leaves_the_directory(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("run", "study.toml", "--out", "a", "--replicates", "10") == 0
    Path("other.toml").write_text(STUDY.replace("seed = 3", "seed = 4"))
    assert run("run", "other.toml", "--out", "a") == 2
    assert "seed 3 there, 4 here" in capsys.readouterr().err
    assert (Path("a") / "study.toml").read_text() == STUDY


# Shards, status, merge ---------------------------------------------------------------------------


def test_shards_merged_are_the_whole_study(results: mf.Results, capsys: pytest.CaptureFixture[str]) -> None:
    for k in range(3):
        assert run("run", "study.toml", "--out", f"s{k}", "--shard", f"{k}/3") == 0
        assert capsys.readouterr().out == ""
    assert run("merge", "s0", "s1", "--out", "all", "--json", "-") == 1
    out, err = capsys.readouterr()
    assert json.loads(out)["missing"] == 2
    assert "2 of 6 parts are missing" in err
    assert run("merge", "s2", "--out", "all") == 0
    assert capsys.readouterr().out == f"{results}\n"
    assert same(mf.load("all"), results)
    notes = [json.loads(line) for line in (Path("all") / "runs.jsonl").read_text().splitlines()]
    assert [note["shard"] for note in notes] == [[0, 3], [1, 3], [2, 3]]
    assert (Path("all") / "study.toml").read_text() == STUDY


@pytest.mark.parametrize(
    ("shard", "said"),
    [
        ("3/3", "K is 0 to 2 .*--array=0-2"),
        ("0/0", "K from 0 to N - 1"),
        ("1", "as 3/64"),
        ("-1/3", "as 3/64"),
    ],
)
def test_a_bad_shard_is_told_the_valid_range(
    shard: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("run", "study.toml", "--out", "a", "--shard", shard) == 2
    assert re.search(said, capsys.readouterr().err)
    assert not Path("a").exists()


def test_status_of_a_shard(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("run", "study.toml", "--out", "a", "--shard", "1/4", "--no-progress", "--json", "-") == 0
    told = json.loads(capsys.readouterr().out)
    assert run("status", "a", "--json", "-") == 1
    again = json.loads(capsys.readouterr().out)
    assert again["shards"] == told["shards"]
    assert again["shards"] == {
        "shard": ["0/4", "1/4", "2/4", "3/4"],
        "parts": [2, 2, 1, 1],
        "missing": [2, 0, 1, 1],
        "replicates": [1024, 512 + 100, 512, 512],
        "done": [0, 512 + 100, 0, 0],
    }
    assert (again["done"], again["complete"]) == (612, False)
    assert run("status", "a") == 1
    out = capsys.readouterr().out
    assert "612 of 2,660 replicates are there; 4 of 6 parts are missing" in out


def test_status_names_damaged_parts_and_the_pace(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("run", "study.toml", "--out", "a") == 0
    capsys.readouterr()
    assert run("status", "a") == 0
    assert "complete: 2,660 replicates in 6 parts" in capsys.readouterr().out
    parts = sorted((Path("a") / "parts").iterdir())
    now = time.time()
    for k, path in enumerate(parts):
        os.utime(path, (now, now - 100 + 10 * k))  # a part each 10 s, the last one 50 s ago
    parts[2].write_bytes(parts[2].read_bytes()[:-1])
    os.utime(parts[2], (now, now))
    parts[5].unlink()
    assert run("status", "a") == 1
    out = capsys.readouterr().out
    assert f"damaged, and made again by the next run: {parts[2]}" in out
    # Four parts are left, the first written 40 s before the last.
    assert "38.4 replicates/s over the last parts, at which 0:00:15 are left" in out
    assert re.search(r"written 0:01:0\d ago", out)
    assert run("run", "study.toml", "--out", "a") == 0
    assert run("status", "a") == 0


@pytest.mark.process
def test_status_of_a_run_that_was_killed_on_its_way_to_a_limit(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    looked = study_run.far_from
    looks = iter(range(100))

    def third_look(*given: Any) -> float:
        if next(looks) == 2:
            raise KeyboardInterrupt
        return looked(*given)

    words = ["run", "study.toml", "--out", "a", "--until", "bias=0.003"]
    with monkeypatch.context() as patch:
        patch.setattr(study_run, "far_from", third_look)
        assert run(*words) == 130
    assert run("status", "a") == 1
    assert "1,536 replicates are there; --until bias=0.003 is not reached" in capsys.readouterr().out
    assert run(*words) == 0
    assert run("status", "a") == 0
    unbroken = python().run(until={"bias": 0.003}, progress=False)
    assert unbroken.replicates > 1536
    assert same(mf.load("a"), unbroken)


def test_clock() -> None:
    assert clock(3725.9) == "1:02:05"


# replicate and report ----------------------------------------------------------------------------


def test_a_replicate_made_again(results: mf.Results, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("run", "study.toml", "--out", "a") == 0
    capsys.readouterr()
    cell = ["--cell", "system=two", "--cell", "nsr=0.40"]
    assert run("replicate", "a", "99", *cell, "--csv", "r.csv") == 0
    out, err = capsys.readouterr()
    rec, fits = results.replicate(99, system="two", nsr=0.4)
    for name, fit in fits.items():
        assert f"\n{name}\n{fit.summary()}\n" in out
    assert err == "modfun: wrote r.csv\n"
    read = mf.read("r.csv", time="t", outputs=["y"], inputs=["u"])
    np.testing.assert_array_equal(read.y, rec.y)
    np.testing.assert_array_equal(read.u, rec.u)
    assert run("replicate", "a", "99", *cell, "--json", "-") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["ml"]["params"] == fits["ml"].params.tolist()


def test_a_replicate_of_a_study_that_is_not_complete(
    results: mf.Results, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("run", "study.toml", "--out", "a", "--shard", "1/2") == 0
    assert run("replicate", "a", "99", "--cell", "system=two", "--cell", "nsr=0.4", "--json", "-") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["ml"]["params"] == results.replicate(99, system="two", nsr=0.4)[1]["ml"].params.tolist()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["99"], "which system"),
        (["99", "--cell", "system=tow", "--cell", "nsr=0.1"], "did you mean 'two'"),
        (["99", "--cell", "sytem=two"], "did you mean 'system'"),
        (["99", "--cell", "system"], "give a name and a value, as nsr=0.2"),
        (["99", "--cell", "nsr=0.1", "--cell", "nsr=0.4"], "given twice"),
        (["2660", "--cell", "system=two", "--cell", "nsr=0.1"], "0 to 2659"),
    ],
)
def test_a_bad_address_is_exit_code_2(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    python().run(directory="a", progress=False)
    assert run("replicate", "a", *words) == 2
    assert said in capsys.readouterr().err


class Page(HTMLParser):
    """Collects what a page would load, its headings, and tags left open."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "use", "path"):
            self.open.append(tag)
        for name, value in attributes:
            if name in ("src", "href", "xlink:href", "srcset", "data", "action") and not str(
                value
            ).startswith("#"):
                self.loads.append(f"{tag} {name}={value}")
        if tag in ("script", "link", "iframe", "img", "object", "embed"):
            self.loads.append(tag)

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attributes)
        if tag not in ("meta", "use", "path"):
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag in ("use", "path"):
            return
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_report_is_one_page_that_loads_nothing(results: mf.Results) -> None:
    pytest.importorskip("matplotlib")
    assert run("run", "study.toml", "--out", "a<b") == 0
    assert run("report", "a<b", "--out", "r.html") == 0
    text = Path("r.html").read_text(encoding="utf-8")
    page = Page()
    page.feed(text)
    page.close()
    assert page.open == []
    assert page.loads == []
    assert not re.search(r"@import|url\((?!#)", text)
    assert text.count("<svg") == 1
    manifest = json.loads((Path("a<b") / "manifest.json").read_text())
    for words in (
        "Monte Carlo study a<b", manifest["study"], *manifest["files"].values(), mf.__version__,
        "2,660 replicates in each of 4 cells", "seed = 3", "nonfinite", sys.version.split()[0],
    ):  # fmt: skip
        assert words in page.text, words
    table = results.table()
    assert str(table).splitlines()[2].split()[-2] in page.text  # a bound
    before = text
    assert run("report", "a<b", "--out", "r.html") == 0
    assert Path("r.html").read_text(encoding="utf-8") == before


def test_a_report_overwrites_pages_only(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("run", "study.toml", "--out", "a", "--replicates", "10") == 0
    part = next(Path("a", "parts").iterdir())
    kept = {path: path.read_bytes() for path in (Path("study.toml"), Path("a/manifest.json"), part)}
    Path("link.html").symlink_to("study.toml")
    capsys.readouterr()
    for out, said in (
        ("study.toml", "no .html file, so that it stays as it is; name a new file, as report.html"),
        ("link.html", "no .html file, so that it stays as it is"),
        ("a/manifest.json", "is the place of manifest.json, which belongs to the study in"),
        ("a/samples.npy", "is the place of samples.npy, which belongs to the study in"),
        (str(part), "is the place of parts, which belongs to the study in"),
    ):
        assert run("report", "a", "--out", out) == 2
        assert f"mc report: --out {out} {'' if 'place' in said else 'is there already and '}{said}" in (
            capsys.readouterr().err
        )
    assert {path: path.read_bytes() for path in kept} == kept
    assert not Path("a/samples.npy").exists()


def test_a_report_without_an_axis_of_numbers_says_why_there_is_no_figure() -> None:
    pytest.importorskip("matplotlib")
    Path("study.toml").write_text(STUDY.replace("[0.1, 0.4]", "0.1"))
    assert run("run", "study.toml", "--out", "a", "--replicates", "10") == 0
    assert run("report", "a", "--out", "r.html") == 0
    text = Path("r.html").read_text(encoding="utf-8")
    assert "one noise level and no axis of numbers" in text
    assert "<svg" not in text


def test_a_report_over_an_axis_of_ones_own(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    Path("study.toml").write_text("""
        generate = "study_functions_kit:student"
        grid = { df = [3, 30], name = ["a", "b"] }
        truth = { a1 = 3.0, a2 = 8.0, b0 = 5.0 }
        estimators = ["ls"]
        metrics = { gain = "study_functions_kit:gain" }
        model = { poles = 2, zeros = 0 }
        harmonics = 6
        replicates = 10
    """)
    assert run("run", "study.toml", "--out", "a") == 0
    assert run("report", "a", "--out", "r.html") == 0
    text = Path("r.html").read_text(encoding="utf-8")
    assert ">df</text>" in text  # drawn words are text
    assert ">b</text>" in text
    assert "<h2>Metrics</h2>" in text


# Signals and bad use -----------------------------------------------------------------------------


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_ctrl_c_says_how_to_go_on() -> None:
    Path("slow_kit.py").write_text("def peak(fit, rec):\n    return float(abs(rec.y).max())\n")
    Path("study.toml").write_text(STUDY + '\n[metrics]\npeak = "slow_kit:peak"\n')
    words = [sys.executable, "-m", "modfun", "mc", "run", "study.toml", "--out", "a", "--replicates"]
    process = subprocess.Popen(
        [*words, "1000000"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Tests that a shell started in the background ignore interrupts, and so would what they start.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    parts = Path("a") / "parts"
    deadline = time.monotonic() + 60
    while not (parts.exists() and len(list(parts.glob("*.part"))) > 1):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert out == ""
    assert "kept in a: the same command goes on from there" in err
    assert "Traceback" not in err
    assert run("status", "a") == 1


BAD: dict[str, tuple[list[str], str]] = {
    "no study": (["run", "no.toml", "--out", "a"], "mc init"),
    "no out": (["run", "study.toml"], "--out"),
    "words of keep": (["run", "study.toml", "--out", "a", "--keep", "all"], "samples"),
    "until without number": (["run", "study.toml", "--out", "a", "--until", "bias=low"], "not a number"),
    "until of nothing": (["run", "study.toml", "--out", "a", "--until", "bias"], "bias=0.001"),
    "until of another figure": (["run", "study.toml", "--out", "a", "--until", "bais=1"], "bias"),
    "until and shard": (["run", "study.toml", "--out", "a", "--until", "bias=1", "--shard", "0/2"], "until"),
    "out is a file": (["run", "study.toml", "--out", "study.toml"], "is a file"),
    "status of nothing": (["status", "nowhere"], "no directory of a study"),
    "merge of nothing": (["merge", "nowhere", "--out", "all"], "no directory of a study"),
    "report of nothing": (["report", "nowhere", "--out", "r.html"], "no directory of a study"),
    "page into no folder": (["report", "DONE", "--out", "no/r.html"], "no/r.html"),
    "init into no folder": (["init", "no/study.toml"], "no/study.toml"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_use_is_exit_code_2_with_one_sentence(case: str, capsys: pytest.CaptureFixture[str]) -> None:
    words, said = BAD[case]
    if "DONE" in words:
        python().run(directory="DONE", replicates=10, progress=False)
    assert run(*words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert "Traceback" not in err


def test_a_module_that_leaves_python_is_exit_code_2(capsys: pytest.CaptureFixture[str]) -> None:
    Path("study_kit_leaves.py").write_text("import sys\nsys.exit(0)\n")
    Path("leaves.toml").write_text('noise = "study_kit_leaves:f"\n' + STUDY)
    assert run("run", "leaves.toml", "--out", "a") == 2
    assert "study_kit_leaves cannot be imported: SystemExit: 0" in capsys.readouterr().err
    assert not Path("a").exists()


@pytest.mark.parametrize("line", ["raise SystemExit(0)", "1 / 0"])
def test_a_study_is_read_though_its_module_fails_by_now(
    line: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"study_kit_changed_{len(line)}"
    module = Path(f"{name}.py")
    module.write_text("def f(rng, y, dt):\n    return rng.standard_normal(y.size)\n")
    Path("own.toml").write_text(f'noise = "{name}:f"\n' + STUDY)
    assert run("run", "own.toml", "--out", "a", "--replicates", "3") == 0
    monkeypatch.delitem(sys.modules, name)
    importlib.invalidate_caches()
    module.write_text(f"{line}\n")
    assert run("status", "a") == 0
    assert run("replicate", "a", "0", "--cell", "system=two", "--cell", "nsr=0.1") == 2
    said = "SystemExit: 0" if "Exit" in line else "ZeroDivisionError: division by zero"
    assert f"{name}:f of this study cannot be imported ({said})" in capsys.readouterr().err


def test_an_unfinished_study_has_no_report_yet(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("run", "study.toml", "--out", "a", "--shard", "0/2") == 0
    assert run("report", "a", "--out", "r.html") == 2
    assert "3 of 6 parts" in capsys.readouterr().err


def test_a_disk_that_fails_is_exit_code_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*given: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    assert run("run", "study.toml", "--out", "a") == 1
    assert "make room" in capsys.readouterr().err


def test_messages_name_keys_of_the_file_and_no_options(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = tmp_path / "study.toml"
    path.write_text('initial_state = "rest"' + STUDY)
    assert main(["mc", "run", str(path), "--out", str(tmp_path / "runs")]) == 2
    said = capsys.readouterr().err
    assert "initial_state='rest' is unknown; give 'zero', 'random', 2 numbers or a function of rng" in said
    assert "mf.Estimator(structure, initial_state='rest')" in said
