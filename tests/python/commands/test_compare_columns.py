"""`modfun compare` on a file whose columns have other names than the channels of the fit."""

import modfun as mf
import numpy as np
import pytest
from modfun.commands.main import main

pytest.importorskip("typer")


def test_the_columns_of_the_fit_are_to_be_given_again(tmp_path, capsys):
    t = np.arange(300) * 0.05
    u = np.sin(t**2 / 5)
    y = mf.tf([5], [1, 3, 8]).simulate(u=u, dt=0.05)
    path, fit = tmp_path / "run.csv", tmp_path / "fit.json"
    path.write_text(
        "time,DE (deg),Q (deg/s)\n" + "\n".join(map("{:.6g},{:.9g},{:.9g}".format, t, u, np.ravel(y)))
    )
    named = ["--output", "q=Q (deg/s)", "--input", "de=DE (deg)"]
    assert main(["fit", str(path), *named, "--poles", "2", "--zeros", "0", "--json", str(fit)]) == 0
    capsys.readouterr()
    assert main(["compare", str(fit), str(path)]) == 2
    text = " ".join(capsys.readouterr().err.split())
    assert "names of the fit's channels (q, de)" in text
    assert "repeat --output NAME=COLUMN, --input NAME=COLUMN and --convert as given to modfun fit" in text
    assert main(["compare", str(fit), str(path), *named]) == 0
