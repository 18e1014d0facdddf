"""Splines through samples of smooth inputs."""

import numpy as np
from modfun.systems.propagate import spline


def test_a_spline_is_made_once():
    grid, values = np.arange(20.0), np.sin(np.arange(20.0))
    assert spline(grid, values) is spline(grid.copy(), values.copy())
    assert spline(grid, values)(2.5) != spline(grid, 2 * values)(2.5)
