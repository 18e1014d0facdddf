"""Standard normals in numba, sixteen streams side by side: xoshiro256++, Box and Muller by polynomials."""

from math import sqrt

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .polynomials import COS, LOG, ROOT, SIN

W = 16
PAIRS = 129
JIT = {"fastmath": {"contract"}, "error_model": "numpy", "boundscheck": False}


@intrinsic
def as_float(typing, bits):
    """The double with these bits."""

    def code(context, builder, signature, args):
        return builder.bitcast(args[0], ir.DoubleType())

    return types.float64(types.uint64), code


@intrinsic
def as_bits(typing, value):
    """The bits of a double."""

    def code(context, builder, signature, args):
        return builder.bitcast(args[0], ir.IntType(64))

    return types.uint64(types.float64), code


ONE, MANTISSA = np.uint64(0x3FF0000000000000), np.uint64(0x000FFFFFFFFFFFFF)
LOW = np.uint64(int(np.float64(ROOT).view(np.uint64)))
UP = np.uint64(0x3FF0000000000000 - int(LOW))
MAGIC, OFFSET = np.uint64(0x4330000000000000), 4503599627370496.0 + 1023.0
SIGN = np.uint64(1 << 63)
U12, U17, U19, U23, U41, U45, U52 = (np.uint64(k) for k in (12, 17, 19, 23, 41, 45, 52))
LN2, QUARTER_TURN = np.log(2.0), np.pi / 2


def seeded(seed):
    """States of sixteen streams, (4 · 16)."""
    return np.random.SeedSequence(seed).generate_state(4 * W, np.uint64)


@numba.njit(**JIT)
def normals(state, pairs, out, width):
    """2 · `pairs` normals of every stream into out (pairs, 2 · 16)."""
    for p in range(pairs):
        both = out[p]
        for lane in range(width):
            a, b, c, d = state[lane], state[W + lane], state[2 * W + lane], state[3 * W + lane]
            t = a + d
            first = ((t << U23) | (t >> U41)) + a
            t = b << U17
            c ^= a
            d ^= b
            b ^= c
            a ^= d
            c ^= t
            d = (d << U45) | (d >> U19)
            t = a + d
            second = ((t << U23) | (t >> U41)) + a
            t = b << U17
            c ^= a
            d ^= b
            b ^= c
            a ^= d
            c ^= t
            d = (d << U45) | (d >> U19)
            state[lane], state[W + lane], state[2 * W + lane], state[3 * W + lane] = a, b, c, d
            # -2 ln u, u in (0, 1]
            u = 2.0 - as_float((first >> U12) | ONE)
            bits = as_bits(u) + UP
            exponent = as_float((bits >> U52) | MAGIC) - OFFSET
            g = as_float((bits & MANTISSA) + LOW) - 1.0
            poly = LOG[9]
            for k in range(9):
                poly = poly * g + LOG[8 - k]
            log = exponent * LN2 + (g + g * g * (g * poly - 0.5))
            radius = sqrt(-2.0 * log)
            # half the angle in ±π/4, doubled; a further bit turns it by π
            half = (as_float((second >> U12) | ONE) - 1.5) * QUARTER_TURN
            x = half * half
            sine, cosine = SIN[4], COS[4]
            for k in range(4):
                sine = sine * x + SIN[3 - k]
                cosine = cosine * x + COS[3 - k]
            sine = half * sine
            signed = as_float(as_bits(radius) ^ (second << np.uint64(63)))
            both[lane] = signed * (cosine * cosine - sine * sine)
            both[W + lane] = signed * (2.0 * sine * cosine)
