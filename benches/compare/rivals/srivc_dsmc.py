"""The crate dsmc's SRIVC (Rust): given records, so that neither noise nor the way to it costs anything."""

import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parents[1] / "dsmc"
TARGET = Path(__file__).resolve().parents[3] / "target" / "dsmc"


def build():
    """Compile it, for the processor it runs on."""
    env = {**os.environ, "CARGO_TARGET_DIR": str(TARGET), "RUSTFLAGS": "-C target-cpu=native"}
    subprocess.run(["cargo", "build", "--release", "--quiet"], cwd=HERE, env=env, check=True)


class Dsmc:
    """A process that keeps records (record, time) of one input and estimates all of them when it is asked.

    `cutoff`, rad/s: of its first filter, which works best at about the natural frequency. `start`: the first
    sample of its sums; it knows no initial state, but can leave out a transient.
    """

    def __init__(self, u, y, dt, poles, zeros, cutoff, held=False, start=0):
        build()
        self.count = poles + zeros + 1
        head = [u.size, len(y), dt, cutoff, poles, zeros, float(held), start]
        with tempfile.NamedTemporaryFile(suffix=".bin", delete=False) as file:
            file.write(np.concatenate([head, u, np.ravel(y)]).astype("<f8").tobytes())
        self.file = Path(file.name)
        self.process = subprocess.Popen(
            [TARGET / "release" / "dsmc-rival", file.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, iterations=20, tolerance=1e-8):
        """(ns a record, θ (record, parameter)), to the crate's own tolerance; NaN where it fails."""
        self.process.stdin.write(f"{iterations} {tolerance}\n")
        self.process.stdin.flush()
        each, *theta = map(float, self.process.stdout.readline().split())
        return each, np.reshape(theta, (-1, self.count))

    def turn(self, count):
        """ns a record; always all of them."""
        return self.run()[0]

    def close(self):
        """End the process."""
        self.process.stdin.close()
        self.process.wait()
        self.file.unlink()


class Batch:
    """In the shape of the other rivals; `late`: the share of a record that its sums leave out."""

    def __init__(self, problem, late=0.0):
        self.problem, self.start = problem, round(late * problem.u.size)

    def process(self, records):
        """The process with these records."""
        p = self.problem
        y = np.array([rec.y[0] for rec in records])
        return Dsmc(p.u, y, p.dt, p.poles, p.zeros, p.cutoff, p.hold == "zoh", self.start)

    def many(self, records):
        """θ of each record."""
        process = self.process(records)
        _, theta = process.run(iterations=100, tolerance=1e-7)
        process.close()
        return theta
