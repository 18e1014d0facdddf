"""`modfun reproduce report`: the small form runs, its numbers are right, its words follow the numbers."""

import json
import struct

import modfun as mf
import numpy as np
import pytest

pytest.importorskip("matplotlib")

from modfun.commands import reproduction


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    return reproduction.report(folder / "made", quick=True, progress=False)


def test_files(answer):
    fig1c, fig2, numbers = answer.files
    for path in (fig1c, fig2):
        data = path.read_bytes()
        assert data[:8] == b"\x89PNG\r\n\x1a\n"
        width, height = struct.unpack(">II", data[16:24])
        assert width >= 1000
        assert height >= 600
    read = json.loads(numbers.read_text(encoding="utf-8"))
    assert read["monte_carlo"]["estimator"].count("ls") == 2 * 2 * len(reproduction.LEVELS)
    assert read["sentences"] == list(answer.sentences)


def test_sampling_errors_fall_at_the_order_of_each_rule(answer):
    rows = {(r["intervals"], r["estimator"], r["rule"]): r["error"] for r in answer.sampling.rows}
    # Staircase 1/N, Gregory 1/N⁵, PEM with a held input 1/N², with its input out of time 1/N.
    for name, rule, power in (
        ("ls", "staircase", 1),
        ("ls", "gregory", 5),
        ("pem", "", 2),
        ("pem, b u(t)", "", 1),
    ):
        slope = np.log2(rows[256, name, rule] / rows[1024, name, rule]) / 2
        assert slope == pytest.approx(power, abs=0.35), name
    assert rows[256, "ls", "staircase"] < 0.03
    assert rows[256, "pem, b u(t)", ""] == pytest.approx(10.2, abs=0.1)


def test_numbers_of_fig_2(answer):
    def of(column, state, nsr, name):
        return reproduction.figure(answer.table, column, state, nsr, name)

    assert of("bias", "zero", 0.0, "ls") < 0.03
    assert of("bias", "zero", 0.6, "ls") == pytest.approx(15.5, abs=3 * 0.37 + 0.2)
    assert of("bias", "zero", 0.6, "ml") < 2
    assert of("sd", "zero", 0.6, "ls") == pytest.approx(11.7, abs=1.2)
    bias = [of("bias", "zero", v, "ls") for v in reproduction.LEVELS]
    assert np.all(np.diff(bias) > 0)
    assert of("bias", "zero", 0.0, "pem, from rest") == pytest.approx(0.14, abs=0.01)


def test_sentences_say_the_numbers(answer):
    text = " ".join(answer.sentences)
    assert f"{reproduction.figure(answer.table, 'bias', 'zero', 0.6, 'ls'):.1f} % at NSR 60 %" in text
    assert "~12 %" in answer.sentences[0]
    assert "6 to 7 %" in text
    assert "five to ten times" in text


def test_words_follow_the_numbers():
    def of(name, column="bias", state="zero", nsr=0.6, large=True):
        return {"bias": 20 * nsr, "bias_mcse": 0.4}[column]

    assert "they agree" in reproduction._growth(of, (0.0, 0.3, 0.6))

    def more(name, column="bias", state="zero", nsr=0.6, large=True):
        return {"bias": 40 * nsr, "bias_mcse": 0.4}[column]

    assert "reaches 12 % at NSR 30 %" in reproduction._growth(more, (0.0, 0.3, 0.6))


def test_terminal(tmp_path, capsys):
    reproduction.report(tmp_path, quick=True, runs=5, many=100, progress=False)
    out = capsys.readouterr().out
    assert "output error" in out
    assert "fig2.png" in out
    assert max(len(line) for line in out.splitlines() if "PEM" in line) <= 120


def test_bad_use(tmp_path):
    taken = tmp_path / "file"
    taken.write_text("")
    with pytest.raises(mf.DataError, match="choose another"):
        reproduction.report(taken / "below", quick=True)
    with pytest.raises(mf.SpecError, match="at least 2"):
        reproduction.report(tmp_path, runs=1)
