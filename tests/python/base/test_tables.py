"""Tables and findings: what they print, that they cannot be changed."""

import copy
import pickle

import numpy as np
import pytest
from modfun import SpecError, Table
from modfun.base.names import nearest
from modfun.base.tables import Findings


@pytest.fixture
def table():
    return Table({"mode": [1, 2], "omega": [2.828, 14.5], "note": ["light", None]}, title="Modes")


def test_print_is_aligned(table):
    lines = ["Modes", "mode   omega  note", "   1   2.828  light", "   2  14.500"]
    assert str(table) == "\n".join(lines)


def test_numbers_of_very_different_size_use_the_short_form():
    assert str(Table({"x": [1.23456789e-12, 3.0, 4e8]})).split() == ["x", "1.2346e-12", "3", "4e+08"]


def test_small_numbers_of_a_column_keep_three_digits():
    assert str(Table({"x": [2.25, 1000.5]})).split() == ["x", "2.25", "1000.50"]


def test_missing_and_infinite_numbers_print():
    assert str(Table({"x": [1.5, None, np.nan, np.inf]})).split() == ["x", "1.5", "nan", "inf"]
    assert "yes" in str(Table({"ok": [True, False]}))
    assert str(Table({})) == ""


def test_columns_rows_and_dictionary(table):
    assert table.columns == ("mode", "omega", "note")
    assert len(table) == 2
    assert table.rows[1] == {"mode": 2, "omega": 14.5, "note": None}
    assert [row["mode"] for row in table] == [1, 2]
    assert table.to_dict() == {"mode": [1, 2], "omega": [2.828, 14.5], "note": ["light", None]}
    assert table["omega"].dtype == np.float64
    assert "omega" in table
    assert "x" not in table


def test_html_escapes():
    shown = Table({"<b>": ["a & b"]}, title="x < y")._repr_html_()
    for text in ("&lt;b&gt;", "a &amp; b", "x &lt; y"):
        assert text in shown
    assert "<b>" not in shown


def test_cannot_be_changed(table):
    with pytest.raises(AttributeError, match="cannot be changed"):
        table.title = "x"
    with pytest.raises(ValueError, match="read-only"):
        table["omega"][0] = 1.0


def test_the_callers_arrays_stay_their_own():
    values = np.array([1.0, 2.0])
    table = Table({"x": values})
    values[0] = 9.0
    assert table["x"][0] == 1.0
    assert values.flags.writeable


def test_pickle_and_copy_keep_it_frozen(table):
    for other in (pickle.loads(pickle.dumps(table)), copy.deepcopy(table)):
        assert other == table
        assert not other["omega"].flags.writeable
    assert table != Table({"mode": [1, 2]})
    assert Table({"x": [np.nan]}) == Table({"x": [np.nan]})


def test_to_pandas(table):
    frame = table.to_pandas()
    assert list(frame.columns) == ["mode", "omega", "note"]
    assert frame["omega"].tolist() == [2.828, 14.5]


def test_unknown_column_names_the_nearest(table):
    with pytest.raises(SpecError, match=r"did you mean 'omega'\? there are: mode, omega, note"):
        table["omgea"]


def test_columns_of_unequal_length_are_refused():
    with pytest.raises(SpecError, match="equal length"):
        Table({"a": [1], "b": [1, 2]})


def test_nearest_finds_by_beginning_and_by_letters():
    assert nearest("q", ["alpha", "Q (deg/s)"]).startswith("did you mean 'Q (deg/s)'?")
    assert nearest("zzz", ["alpha"]) == "there are: alpha"
    assert nearest("zzz", []) == "there are: none"


def test_findings():
    found = Findings("Record", ["one < two", "three"])
    assert len(found) == 2
    assert "three" in found
    assert list(found) == ["one < two", "three"]
    assert str(found) == "Record:\n* one < two\n* three"
    assert "one &lt; two" in found._repr_html_()
    assert pickle.loads(pickle.dumps(found)).sentences == found.sentences
    with pytest.raises(AttributeError, match="cannot be changed"):
        found.title = "x"


def test_findings_without_a_finding():
    empty = Findings("Record", [])
    assert not empty
    assert str(empty) == "Record: nothing wrong was found."
    assert "nothing wrong" in empty._repr_html_()


def test_text_for_reports() -> None:
    """LaTeX and Markdown escape what they must; CSV keeps every digit."""
    table = Table({"name_1": ["a|b", "50 % & more"], "value": [1 / 3, 2.0], "none": [None, 1.5]})
    latex = table.to_latex().splitlines()
    assert latex[0] == r"\begin{tabular}{lrr}"
    assert latex[2] == r"name\_1 & value & none \\"
    assert latex[5].startswith(r"50 \% \& more & 2.0000 &")
    markdown = table.to_markdown().splitlines()
    assert markdown[:2] == ["| name_1 | value | none |", "|---|---:|---:|"]
    assert markdown[2].startswith(r"| a\|b | 0.3333 |")
    assert table.to_csv().splitlines() == ["name_1,value,none", f"a|b,{1 / 3!r},", "50 % & more,2.0,1.5"]
    assert Table({"x": []}).to_csv() == "x\n"


def test_tables_are_written_to_files(tmp_path):
    table = Table({"mode": [1, 2], "omega": [2.5, 14.5]})
    for name in ("to_csv", "to_markdown", "to_latex"):
        place = tmp_path / name
        text = getattr(table, name)(place)
        assert text == getattr(table, name)()
        assert place.read_text() == text.rstrip("\n") + "\n"
    with pytest.raises(SpecError, match="there is no folder"):
        table.to_csv(tmp_path / "none" / "a.csv")
    with pytest.raises(SpecError, match=r"^Table.to_dict: it takes no arguments; write Table.to_dict\(\)"):
        table.to_dict("a.csv")
    with pytest.raises(SpecError, match=r"Table.to_csv: the file is 3; give its name"):
        table.to_csv(3)


def test_errors_keep_two_digits_beside_a_large_number():
    """A damping has a small error beside a stiffness: 1.20 [1.20, 1.20] told nothing of it."""
    table = Table(
        {
            "value": [1.19986, 400.0392],
            "se": [0.002123, 0.0414],
            "2.5 %": [1.1955, 399.954],
            "low": [0.5, 400],
        }
    )
    assert [line.split() for line in str(table).splitlines()[1:]] == [
        ["1.1999", "0.002123", "1.1955", "0.5"],
        ["400.0392", "0.041400", "399.9540", "400.0"],
    ]
    assert "400.04" in str(Table({"value": [1.19986, 400.0392], "other": [1.0, 2.0]}))
