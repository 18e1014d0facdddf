"""Commands in the place of a surface, whose steps fall between samples: their delay is named, no rudder."""

import modfun as mf
import numpy as np
import pytest

MODEL = mf.StateSpace(
    [["Za", 1], ["Ma", "Mq"]], [["Zde"], ["Mde"]], states=["alpha", "q"], inputs=["cmd"]
)  # fmt: skip
FINE = 40  # steps in a sample of 0.02 s


def flown(seed: int, unit: float) -> mf.Record:
    """A 3-2-1-1 of a command through a servo of 20 rad/s; its first step is 7 ms behind a sample."""
    rng, h = np.random.default_rng(seed), 0.02 / FINE
    t = h * np.arange(400 * FINE + 1)
    command = np.zeros(t.size)
    for start, stop, sign in ((0, 3, 1), (3, 5, -1), (5, 6, 1), (6, 7, -1)):
        command[(t >= 1.007 + unit * start) & (t < 1.007 + unit * stop)] = 0.05 * sign
    plant = mf.ss([[-1.6, 1.0], [-9.0, -2.5]], [[-0.2], [-14.0]], [[1, 0], [0, 1]])
    servo = mf.tf([400], [1, 28, 400])
    surface = servo.simulate(u=command, dt=h, intersample="zoh")
    y = plant.simulate(u=surface, dt=h, intersample="smooth", initial_state=[0.01, 0.0])
    noise = np.array([[0.0025], [0.004]]) * rng.standard_normal((2, 401))
    u = command[::FINE]
    return mf.Record(
        y=y[:, ::FINE] + noise, u=u, dt=0.02, outputs=["alpha", "q"], inputs=["cmd"], intersample="zoh"
    )


def test_the_delay_of_a_command_comes_before_noise_that_drives():
    records = [flown(seed, unit) for seed, unit in enumerate((0.4, 0.5, 0.35))]
    with pytest.warns(mf.ModfunWarning, match=r"First try (a delay|a lag of the actuator) of cmd"):
        mf.fit(records, MODEL)
