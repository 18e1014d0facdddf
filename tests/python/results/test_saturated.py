"""Outputs that sit at an extreme, beside what looks like a wrong number in the equations."""

import numpy as np
from flights import SHORT, flown, warned


def test_a_gyro_that_saturates_is_named_before_a_number():
    for seed in range(3):
        rec = flown(seed)
        most = 0.5 * np.abs(rec["q"]).max()
        text = warned(rec.assign(q=np.clip(rec["q"], -most, most)), SHORT)[1]
        assert text.startswith("fit: Output 'q' may be clipped")
