"""After the flight: from the file of a data system to stability and control derivatives (docs/flight.md).

python examples/flight_test.py                          # run7.csv: a sample flight, made where there is none
python examples/flight_test.py --figures docs/figures   # draws the figures of the page, too
python examples/flight_test.py my_flight.csv            # your own file, columns as in COLUMNS
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import modfun as mf
import numpy as np

# The aircraft of the sample: short period, angles in rad or all in deg, stick to elevator with a delay.
TRUTH = {"Za": -0.9, "Zde": -0.12, "Ma": -5.2, "Mq": -1.4, "Mde": -7.5}
GEARING, DELAY = -2.0, 0.12  # deg of elevator an inch of stick; s
COLUMNS = {"alpha": "ALPHA (deg)", "q": "Q (deg/s)"}, {"de": "DELE (deg)", "stick": "STICK (in)"}
STEP = 0.02
SAMPLE = Path("run7.csv")

short_period = mf.StateSpace(
    A=[["Za", 1], ["Ma", "Mq"]], B=[["Zde"], ["Mde"]], states=["alpha", "q"], inputs=["de"]
)


# Pitch rate from stick: K (s + 1/T) exp(-tau s)/(s^2 + 2 zeta omega s + omega^2).
lower_order = mf.TransferFunction(poles=2, zeros=1, delay=mf.Free(min=0, max=0.4))
FORM = {
    "K": "b0",
    "T": "b0/b1",
    "omega": "sqrt(a2)",
    "zeta": "a1/(2*sqrt(a2))",
    "tau": "delay",
}


def lower_order_truth() -> dict[str, float]:
    """What the sample's pitch rate from stick has for K, T, omega, zeta, tau."""
    za, zde, ma, mq, mde = TRUTH.values()
    omega = np.sqrt(za * mq - ma)
    zero = (ma * zde - mde * za) / mde
    gain = np.deg2rad(GEARING) * mde
    return {"K": gain, "T": 1 / zero, "omega": omega, "zeta": -(za + mq) / (2 * omega), "tau": DELAY}


def write_sample(path: Path) -> None:
    """A flight with three manoeuvres and a fourth for prediction: trimmed, with noise and a dropout."""
    rng = np.random.default_rng(11)
    count = int(90 / STEP) + 1
    t = STEP * np.arange(count)
    stick, event = np.zeros(count), np.zeros(count)
    patterns = [[1, 1, 1, -1, -1, 1, -1], [0, 1, 1, -1, -1], [-1, -1, -1, 1, 1, -1, 1], [1, 1, -1, 1]]
    for k, (pattern, width) in enumerate(zip(patterns, [0.6, 0.8, 0.5, 0.9], strict=True)):
        start = 6.0 + 21.0 * k
        event[(t >= start - 1.0) & (t <= start + 12.0)] = 1
        for j, sign in enumerate(pattern):
            stick[(t >= start + width * j - 1e-9) & (t < start + width * (j + 1) - 1e-9)] = 1.1 * sign
    stick = np.convolve(
        np.pad(stick, 8, mode="edge"), np.hanning(19)[1:-1] / 9.0, "valid"
    )  # a hand, no relay
    late = round(DELAY / STEP)
    de = GEARING * np.concatenate([np.zeros(late), stick[:-late]])
    aircraft = short_period.model(TRUTH)
    alpha, q = aircraft.simulate(u=[de], dt=STEP, intersample="smooth")
    alpha, q = (x + s * rng.standard_normal(count) for x, s in ((alpha, 0.08), (q, 0.15)))
    measured = de + 0.01 * rng.standard_normal(count), stick + 0.004 * rng.standard_normal(count)
    table = np.column_stack([36000 + t, event, measured[1] + 0.35, measured[0] - 2.1, alpha + 6.2, q + 0.4])
    lines = [",".join(["TIME [s]", "EVENT", "STICK (in)", "DELE (deg)", "ALPHA (deg)", "Q (deg/s)"])]
    for k, row in enumerate(table):
        words = [f"{value:.7g}" for value in row]
        if 2700 <= k < 2707:  # seven samples of the vane are lost in the third manoeuvre
            words[4] = ""
        lines.append(",".join(words))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_flight(path: str | Path) -> list[mf.Record]:
    """The manoeuvres of a flight, angles in rad."""
    print(mf.columns(path))
    flight = mf.read(
        path,
        time="TIME [s]",
        outputs=COLUMNS[0],
        inputs=COLUMNS[1],
        keep={"event": "EVENT"},
        missing="mask",
        intersample="smooth",  # measured motions of surface and stick
    ).convert(alpha="rad", q="rad/s", de="rad")
    print(flight)
    print(flight.check())
    return flight.split(on="event")


def augmented(share: float = 2e-4) -> mf.Record:
    """A record under feedback de = .8 alpha + .4 q + share·doublet (rad): little of the elevator is free."""
    pilot = np.zeros(601)
    pilot[50:100], pilot[100:150] = 1.0, -1.0
    model = short_period.model(TRUTH)
    assert model.matrices is not None  # as of every state-space model
    a, b, _, _ = model.matrices
    gain = np.array([[0.8, 0.4]])
    loop = mf.ss(a + b @ gain, b * share, np.vstack([np.eye(2), gain]), [[0.0], [0.0], [share]])
    alpha, q, de = loop.simulate(u=[pilot], dt=STEP, initial_state=[0.02, 0.0])
    noise = 0.0002 * np.random.default_rng(5).standard_normal((2, alpha.size))
    return mf.Record(y=np.array([alpha, q]) + noise, u=de, dt=STEP, outputs=["alpha", "q"], inputs=["de"])


def analyse(path: str | Path) -> tuple[mf.Fit, mf.Record, mf.Fit]:
    """Derivatives from all manoeuvres but the last, which is predicted; the lower-order system."""
    *used, last = read_flight(path)
    runs = [run.select(inputs=["de"]) for run in used]
    derivatives = mf.fit(runs, short_period)
    print(derivatives.summary())
    print(derivatives.table(units=dict(zip(TRUTH, ["1/s", "1/s", "1/s^2", "1/s", "1/s^2"], strict=True))))
    print("\nEach manoeuvre simulated, and the last, which was not used:")
    print(derivatives.score())
    unseen = last.select(inputs=["de"])
    print(derivatives.score(unseen))
    print(mf.collinearity(runs, derivatives))

    sticks = [run.select(outputs=["q"], inputs=["stick"]) for run in used]
    equivalent = mf.fit(sticks, lower_order)
    print(equivalent.check())
    print(equivalent.derived(**FORM))
    return derivatives, unseen, equivalent


def draw(derivatives: mf.Fit, unseen: mf.Record, equivalent: mf.Fit, folder: str | Path) -> None:
    """The page's figures."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(4, 1, figsize=(7, 6), sharex=True, layout="constrained")
    derivatives.plot_response(unseen, ax=axes)
    figure.savefig(Path(folder) / "flight_prediction.png", dpi=85)
    figure, axes = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
    assert equivalent.records is not None  # they are only of a fit that was saved and loaded
    response = mf.frf(equivalent.records, band=(0.9, 12.0))
    mf.plot.bode(equivalent, response, labels=["lower order", "without a model"], ax=axes)
    figure.savefig(Path(folder) / "flight_bode.png", dpi=110)
    plt.close("all")


def main(arguments: Sequence[str] = ()) -> tuple[mf.Fit, mf.Record, mf.Fit]:
    """Analyse a file, the sample where none is given; it is made where it is not there."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", nargs="?", type=Path, default=SAMPLE)
    parser.add_argument("--figures", metavar="DIRECTORY", help="draw the figures of the page there")
    given = parser.parse_args(arguments)
    if given.file == SAMPLE and not SAMPLE.exists():
        write_sample(SAMPLE)
    found = analyse(given.file)
    if given.figures:
        draw(*found, given.figures)
    print("\nControl augmentation moves the elevator with alpha and q:")
    print(mf.collinearity(augmented(), short_period))
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
