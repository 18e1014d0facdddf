"""Codes for missing values are named first, by fits, also in other units, and by the columns of a file."""

import modfun as mf
import numpy as np
import pytest
from flights import SHORT, flown, warned


def coded(seed, code=-9999.0):
    rec, rng = flown(seed), np.random.default_rng(seed)
    alpha = np.rad2deg(rec["alpha"])
    alpha[rng.choice(alpha.size, 8, replace=False)] = code
    return rec.assign(alpha=np.deg2rad(alpha))


@pytest.mark.parametrize("seed", range(4))
def test_a_fit_names_the_code_and_its_mask_leaves_it_out(seed):
    """It failed for samples that "cannot tell the parameters apart"; the mask of a rounded code held none."""
    rec = coded(seed)
    text = warned(rec, SHORT)[1]
    assert text.startswith("fit: Output 'alpha': 8 samples are exactly -174.515, far from all others")
    cure = text.split("leave them out, ")[1].rstrip(".")
    assert warned(eval(cure, {"rec": rec, "np": np}), SHORT)[1] == ""


def test_a_code_in_one_of_several_records_is_named_with_it():
    text = warned([flown(0), coded(1)], SHORT)[1]
    assert text.startswith("fit: Record 1: Output 'alpha': 8 samples are exactly -174.515")


def test_columns_note_a_code(tmp_path):
    path, rec = tmp_path / "flight.csv", coded(0)
    rows = np.column_stack([rec.t, np.round(np.rad2deg(rec["alpha"]), 4), rec["de"]])
    np.savetxt(path, rows, delimiter=",", header="t,alpha,de", comments="")
    assert list(mf.columns(path)["note"])[1:] == ["8 values of -9999: a code?", ""]


def test_fits_that_fail_name_samples_that_stand_out():
    rec = flown(0)
    alpha = rec["alpha"].copy()
    alpha[[100, 300]] = 1e5, -2e5
    fit, text = warned(rec.assign(alpha=alpha), SHORT)
    assert "Output 'alpha' has 2 outlying samples, the first at t = 2 s" in text, fit


def test_a_speed_in_knots_in_the_row_of_an_accelerometer_is_named():
    row = f"{60 / 0.5144}*"
    model = SHORT._like(
        C=[[0, 1], [f"{row}Za", 0]], D=[[0], [f"{row}Zd"]], outputs=["q", "az"]
    )  # fmt: skip
    for seed in range(3):
        text = warned(flown(seed, force=True, nsr=0.03).select(outputs=["q", "az"]), model)[1]
        assert "in m/s² beside a speed in knots, 0.514 times what the equations need" in text


def test_a_state_with_the_name_of_another_output_is_to_be_renamed():
    with pytest.raises(mf.SpecError, match=r"states=\['alpha_itself', 'q'\]"):
        SHORT._like(D=[[1], [0]], C=[[1, 0], [0, 1]], outputs=["alpha", "q"])
