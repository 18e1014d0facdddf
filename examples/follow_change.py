"""Follow an aircraft whose short period changes in flight: a window, and a memory that fades.

python examples/follow_change.py

Elevator to pitch rate; at 30 s the natural frequency falls from 2.5 to 1.8 rad/s, as after a loss of tail
effectiveness. The estimates come while the samples do.
"""

import modfun as mf
import numpy as np

BEFORE, AFTER, CHANGE, END = 2.5, 1.8, 30.0, 60.0
DT = 0.02


def flight(seed: int = 4) -> mf.Record:
    """Small elevator movements all the time, pitch rate with 5 % of noise."""
    half = round(CHANGE / DT)
    t = DT * np.arange(round(END / DT) + 1)
    omega = np.array([0.9, 1.5, 2.3, 3.1, 4.4, 5.9])
    elevator = 0.01 * np.sin(omega[:, None] * t + np.arange(6)[:, None] ** 2).sum(axis=0)

    def aircraft(wn: float) -> mf.LTI:
        # alpha' = -alpha + q, q' = -(wn² - 1.2) alpha - 1.2 q - 6 de: alpha and q go on when wn jumps.
        return mf.ss([[-1.0, 1.0], [-(wn**2) + 1.2, -1.2]], [[0.0], [-6.0]], np.eye(2), np.zeros((2, 1)))

    first = aircraft(BEFORE).simulate(u=elevator[: half + 1], dt=DT)
    second = aircraft(AFTER).simulate(u=elevator[half:], dt=DT, initial_state=first[:, -1])
    q = np.concatenate([first[1], second[1, 1:]])
    q = q + 0.05 * np.std(q) * np.random.default_rng(seed).standard_normal(q.size)
    return mf.Record(y=q, u=elevator, dt=DT, outputs=["q"], inputs=["de"])


def main() -> dict[str, mf.Track]:
    """Estimates five times a second by a window of 8 s, alone and with a memory of 16 s."""
    rec = flight()
    est = mf.Estimator(mf.TransferFunction(poles=2, zeros=1), band=7.0)
    tracks = {}
    for name, memory in (("window 8 s", None), ("window 8 s, forgetting 16 s", 16.0)):
        live = mf.Stream(est, dt=DT, window=8.0, outputs="q", inputs="de", forgetting=memory)
        tracks[name] = live.follow(rec, every=10)
        print(f"{name}: {tracks[name]}")
    return tracks


if __name__ == "__main__":
    main()
