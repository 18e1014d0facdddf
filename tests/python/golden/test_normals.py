"""The normals of an address are fixed for ever: pinned bits, and an independent derivation."""

import math

import numpy as np
import pytest
from modfun import _core
from modfun.errors import SpecError

PURPOSES = ["noise_y", "noise_u", "initial_state", "bootstrap", "user"]

GOLDEN = {
    (24, "noise_y", 0, 0, 0): [
        "0x1.0baba6be9ebe8p+0",
        "-0x1.3525336ed0ecep+0",
        "-0x1.c3ae4e9165d6dp-1",
        "0x1.c262066f90316p-2",
    ],
    (24, "noise_y", 0, 1, 0): [
        "0x1.9a4ef42d576ebp-6",
        "-0x1.48e9cab744eb6p-5",
        "0x1.b77e507f129e6p-2",
        "-0x1.e0610824193abp+0",
    ],
    (24, "noise_u", 3, 199, 2): [
        "0x1.47cd6a109d737p+0",
        "-0x1.2cc6b83c69d3ep-1",
        "0x1.bf4805eaaa376p+0",
        "0x1.f644d52296060p-3",
    ],
    (2**64 - 1, "user", 2**27 - 1, 2**64 - 1, 2**32 - 1): [
        "0x1.227ae669780d8p-3",
        "-0x1.156f344501f00p+0",
        "-0x1.6969b84bf51e9p-2",
        "0x1.1b2d389865b40p+0",
    ],
}


def philox(counter, key):
    """Ten rounds of Philox4x32 in plain integers."""
    c, k = list(counter), list(key)
    for _ in range(10):
        p, q = 0xD2511F53 * c[0], 0xCD9E8D57 * c[2]
        c = [(q >> 32) ^ c[1] ^ k[0], q & 0xFFFFFFFF, (p >> 32) ^ c[3] ^ k[1], p & 0xFFFFFFFF]
        k = [(k[0] + 0x9E3779B9) & 0xFFFFFFFF, (k[1] + 0xBB67AE85) & 0xFFFFFFFF]
    return c


def draws(state):
    """xoshiro256++ in plain integers."""
    mask = 2**64 - 1

    def rotate(x, k):
        return ((x << k) | (x >> (64 - k))) & mask

    a, b, c, d = state
    while True:
        yield (rotate((a + d) & mask, 23) + a) & mask
        t = (b << 17) & mask
        c ^= a
        d ^= b
        b ^= c
        a ^= d
        c ^= t
        d = rotate(d, 45)


def expected(seed, purpose, channel, replicate, group, count):
    """Box and Muller's transform with the C library's functions."""
    words = []
    for block in (0, 1):
        place = PURPOSES.index(purpose) << 28 | channel << 1 | block
        counter = (replicate & 0xFFFFFFFF, replicate >> 32, group, place)
        w = philox(counter, (seed & 0xFFFFFFFF, seed >> 32))
        words += [w[0] | w[1] << 32, w[2] | w[3] << 32]
    stream = draws(words)
    z = []
    while len(z) < count:
        first, second = next(stream), next(stream)
        radius = math.sqrt(-2 * math.log(1 - (first >> 12) / 2**52))
        angle = ((second >> 12) / 2**52 - 0.5) * math.pi / 2
        c, s = radius * math.cos(angle), radius * math.sin(angle)
        c = -c if second & 1 else c
        z += [s, c] if second & 2 else [c, s]
    return np.array(z[:count])


@pytest.mark.parametrize("address", GOLDEN)
def test_pinned_bits(address):
    got = _core.normals(*address, 4)
    assert [x.hex() for x in got.tolist()] == GOLDEN[address]


@pytest.mark.parametrize("address", GOLDEN)
def test_independent_derivation(address):
    np.testing.assert_allclose(_core.normals(*address, 257), expected(*address, 257), rtol=1e-13, atol=1e-15)


def test_a_longer_draw_begins_with_the_shorter():
    long = _core.normals(3, "bootstrap", 0, 5, 0, 100)
    for count in (0, 1, 2, 51):
        np.testing.assert_array_equal(_core.normals(3, "bootstrap", 0, 5, 0, count), long[:count])


def test_bad_addresses():
    with pytest.raises(SpecError, match=r"noise.*noise_y, noise_u, initial_state, bootstrap, user"):
        _core.normals(1, "noise", 0, 0, 0, 1)
    with pytest.raises(SpecError, match="channel 134217728"):
        _core.normals(1, "noise_y", 2**27, 0, 0, 1)
