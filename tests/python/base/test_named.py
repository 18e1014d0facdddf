"""Vectors with names: an array by position and by name, plain once computed with."""

import copy
import pickle

import numpy as np
import pytest
from modfun import SpecError
from modfun.base.named import Named


@pytest.fixture
def vector():
    return Named([2.0, 8.0, 5.0], ["a1", "a2", "b0"], "se")


def test_names_and_positions_agree(vector):
    assert [vector[name] for name in ("a1", "a2", "b0")] == vector[:].tolist() == [2.0, 8.0, 5.0]
    assert "a2" in vector
    assert "a3" not in vector
    with pytest.raises(SpecError, match="no parameter 'a3'; did you mean 'a2' or 'a1'"):
        vector["a3"]


def test_it_is_taken_as_a_mapping(vector):
    assert dict(vector) == {"a1": 2.0, "a2": 8.0, "b0": 5.0}
    assert (lambda **by_name: by_name["b0"])(**vector) == 5.0
    assert [f"{name}: {value:g}" for name, value in vector.items()] == ["a1: 2", "a2: 8", "b0: 5"]


def test_it_prints_as_a_table(vector):
    assert str(vector).split() == ["parameter", "se", "a1", "2", "a2", "8", "b0", "5"]
    assert f"{vector}" == repr(vector) == str(vector)
    assert "<th" in vector._repr_html_()


@pytest.mark.parametrize(
    "made",
    [lambda v: 2 * v, np.sqrt, lambda v: v[1:], lambda v: v @ np.eye(3), np.concatenate],
    ids=["product", "function", "part", "matrix product", "concatenated"],
)
def test_what_is_computed_is_a_plain_array(vector, made):
    found = made([vector, vector]) if made is np.concatenate else made(vector)
    assert type(found) is np.ndarray


def test_copies_have_numbers_and_no_names(vector):
    assert repr(vector.round(1)) == "array([2., 8., 5.])"
    assert isinstance(vector.sum(), float)
    assert copy.deepcopy(vector).tolist() == vector.tolist()


def test_pickles_keep_the_names(vector):
    again = pickle.loads(pickle.dumps(vector))
    assert (again.tolist(), again.names, again.label) == (vector.tolist(), vector.names, "se")
