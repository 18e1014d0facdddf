"""Constants of equations that the lines of a band cannot tell."""

import modfun as mf
import pytest

PLANT = mf.tf([5], [1, 3, 8])
RECORD = mf.simulate(PLANT, input="sin(t**2/5)", duration=20.0, intervals=800, nsr=0.05, seed=1)


@pytest.mark.parametrize("noise", ["output", "process"])
@pytest.mark.parametrize("text", ["y'' + a*y' + b*y + c = d*u", "y'' + a*y' + b*y + exp(c) = d*u"])
def test_a_band_without_line_0_refuses_a_parameter_that_stands_alone(text, noise):
    """It ended as "the samples cannot tell the parameters apart", without a word of the band."""
    with pytest.raises(mf.SpecError, match=r"c stands alone .* band= begins at 0.5 rad/s; begin it at 0"):
        mf.fit(RECORD, mf.Equation(text), band=(0.5, 15.0), noise=noise)
    fit = mf.fit(
        RECORD, mf.Equation("y'' + a*y' + b*y = d*u"), band=(0.5, 15.0), trend="constant", noise=noise
    )
    assert fit.params == pytest.approx([3, 8, 5], rel=0.02)


def test_other_parameters_and_bands_are_not_refused():
    """A prior tells the constant; one that also moves a signal needs no line 0."""
    for text, words in (
        ("y'' + a*y' + b*(y - 1) = d*u", {}),
        ("y'' + a*y' + b*y + c = d*u", {"params": {"c": mf.Free(0.0, sd=0.1)}}),
        ("y'' + a*y' + b*y + c = d*u", {"params": {"c": 0.0}}),
    ):
        assert mf.fit(RECORD, mf.Equation(text, **words), band=(0.5, 15.0))["a"] == pytest.approx(3, rel=0.05)
    assert mf.fit(RECORD, mf.Equation("y'' + a*y' + b*y + c = d*u"), band=15.0).success
