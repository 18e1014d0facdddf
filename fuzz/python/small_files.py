"""Small valid files of each kind that is read: what is spoilt by `texts.py`."""

from __future__ import annotations

import io
import json
from functools import cache

import modfun as mf
import numpy as np

T = 0.1 * np.arange(33)


@cache
def tables() -> list[bytes]:
    rows = [(f"{t:.1f}", f"{np.sin(t):.6f}", str(k)) for k, t in enumerate(T)]
    heads = ("t,y,u", "t [s],y [deg],u", "t;y;u", "t\ty\tu")
    return [
        "\n".join([head, *(sep.join(row) for row in rows)]).encode()
        for head, sep in zip(heads, ",,;\t", strict=True)
    ] + [b"time,y,u\n" + b"".join(b"12:00:%04.1f,%d,1\n" % (t, k) for k, t in enumerate(T.tolist()))]


@cache
def archives() -> list[bytes]:
    found = []
    for save in (np.savez, np.savez_compressed):
        file = io.BytesIO()
        save(file, t=T, y=np.sin(T), u=np.cos(T).astype(np.float32))
        found.append(file.getvalue())
    return found


@cache
def matlab() -> list[bytes]:
    from scipy.io import savemat

    found = []
    given = {"t": T, "y": np.sin(T), "u": np.cos(T)}
    for told in (given, {"run": given, "note": "text"}):
        for words in ({}, {"do_compression": True}, {"format": "4"}):
            if words == {"format": "4"} and told is not given:
                continue
            file = io.BytesIO()
            savemat(file, told, **words)
            found.append(file.getvalue())
    return found


@cache
def fits() -> list[bytes]:
    plant = mf.tf([5], [1, 3, 8])
    rec = mf.simulate(plant, input="sin(t**2/5)", duration=10.0, intervals=64, nsr=0.2)
    models = [mf.TransferFunction(poles=2, zeros=0), mf.Equation("y'' + d*y' + a*y = b*u")]
    return [json.dumps(mf.fit(rec, model, harmonics=6).to_dict()).encode() for model in models]


STUDIES = [
    b"""input = "sin(t**2/5)"
duration = 10.0
intervals = 64
nsr = [0.1, 0.2]
estimators = ["ls", "ml"]
harmonics = 6
system = { num = [5], den = [1, 3, 8], delay = 0.1 }
""",
    b"""replicates = 10
seed = 3
nsr = 0.1
duration = 10.0
intervals = 64
[input]
slow = "sin(t)"
fast = "where(t < 2, 1, sin(3*t))"
[system]
A = [[0, 1], [-8, -3]]
B = [[0], [5]]
C = [[1, 0]]
[model]
poles = 2
zeros = 0
[estimators.one]
method = "awls"
band = [0.5, 8.0]
""",
]
