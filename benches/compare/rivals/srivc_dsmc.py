"""The crate dsmc's SRIVC (Rust): given records, so that its noise costs nothing."""

import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import setting as s

HERE = Path(__file__).resolve().parents[1] / "dsmc"
TARGET = Path(__file__).resolve().parents[3] / "target" / "dsmc"
CUTOFF = 3.0  # rad/s, about the natural frequency: where its first filter works best


class Dsmc:
    """A process that keeps the records and estimates all of them whenever it is asked."""

    def __init__(self, records=256):
        env = {**os.environ, "CARGO_TARGET_DIR": str(TARGET), "RUSTFLAGS": "-C target-cpu=native"}
        subprocess.run(["cargo", "build", "--release", "--quiet"], cwd=HERE, env=env, check=True)
        noise = np.random.default_rng(1).standard_normal((records, s.SAMPLES))
        self.y = s.Y + s.SIGMA * noise
        head = [s.SAMPLES, records, s.DURATION / s.INTERVALS, CUTOFF]
        with tempfile.NamedTemporaryFile(suffix=".bin", delete=False) as file:
            file.write(np.concatenate([head, s.U, self.y.ravel()]).astype("<f8").tobytes())
        self.file = Path(file.name)
        self.process = subprocess.Popen(
            [TARGET / "release" / "dsmc-rival", file.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

        _, self.failures, self.mean = self.run()

    def run(self):
        """(ns a record, failures, mean θ), to the crate's own tolerance in at most 20 iterations."""
        self.process.stdin.write("20 1e-8\n")
        self.process.stdin.flush()
        each, failures, *theta = map(float, self.process.stdout.readline().split())
        return each, int(failures), np.array(theta)

    def turn(self, count):
        """ns a record; always all of them."""
        return self.run()[0]

    def close(self):
        """End the process."""
        self.process.stdin.close()
        self.process.wait()
        self.file.unlink()
