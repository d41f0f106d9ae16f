"""Elliptic integrals of the first kind for compiled code."""

import math

from numba import njit


@njit(cache=True, no_cfunc_wrapper=True)
def carlson_rf(x, y, z):
    """Carlson's R_F(x, y, z), arguments ≥ 0, at most one zero; relative error about 1e-15 (DLMF 19.36(i))."""
    a = (x + y + z) / 3.0
    q = max(abs(a - x), abs(a - y), abs(a - z)) * 400.0
    dx, dy = a - x, a - y
    scale = 1.0
    while scale * q > a:
        sx, sy, sz = math.sqrt(x), math.sqrt(y), math.sqrt(z)
        m = sx * sy + sy * sz + sz * sx
        x, y, z = 0.25 * (x + m), 0.25 * (y + m), 0.25 * (z + m)
        a = 0.25 * (a + m)
        scale *= 0.25
    ex, ey = dx * scale / a, dy * scale / a
    ez = -ex - ey
    e2 = ex * ey - ez * ez
    e3 = ex * ey * ez
    series = 1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0
    series += -5.0 * e2 * e2 * e2 / 208.0 + 3.0 * e3 * e3 / 104.0 + e2 * e2 * e3 / 16.0
    return series / math.sqrt(a)


@njit(cache=True, no_cfunc_wrapper=True)
def complete_k(complement):
    """K as a function of 1 − k², by the arithmetic-geometric mean; inf at 0."""
    if complement <= 0.0:
        return math.inf
    x, y = 1.0, math.sqrt(complement)
    while abs(x - y) > 4e-16 * x:
        x, y = 0.5 * (x + y), math.sqrt(x * y)
    return 0.5 * math.pi / x


@njit(cache=True, no_cfunc_wrapper=True)
def incomplete_f(phi, complement):
    """F(φ, k) as a function of any real φ and 1 − k² ∈ [0, 1]; ±inf beyond ±π/2 for k = 1."""
    turns = math.floor(phi / math.pi + 0.5)
    rest = phi - turns * math.pi
    s, c = math.sin(rest), math.cos(rest)
    value = s * carlson_rf(c * c, c * c + complement * s * s, 1.0)
    if turns != 0.0:
        value += 2.0 * turns * complete_k(complement)
    return value
