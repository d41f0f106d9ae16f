"""Just enough double-double arithmetic for the two invariants of an elastica: about 31 digits.

A double-double is an unevaluated sum (hi, lo) with |lo| ≤ ulp(hi)/2. Algorithms of Dekker and Knuth.
"""

import math

from numba import njit

# π/2 and 1/n! as sums of doubles, from exact integer arithmetic.
_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)


def _inverse_factorials(count):
    """1/n! for n < count as double-doubles, by exact rational arithmetic."""
    from fractions import Fraction

    high, low, value = [], [], Fraction(1)
    for n in range(count):
        if n:
            value /= n
        hi = float(value)
        high.append(hi)
        low.append(float(value - Fraction(hi)))
    return tuple(high), tuple(low)


_INV_FACT_HI, _INV_FACT_LO = _inverse_factorials(24)


@njit(cache=True, no_cfunc_wrapper=True)
def two_sum(a, b):
    """a + b exactly, as (rounded sum, error)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@njit(cache=True, no_cfunc_wrapper=True)
def two_product(a, b):
    """a·b exactly, as (rounded product, error); |a|, |b| below 1e150."""
    p = a * b
    t = 134217729.0 * a
    ah = t - (t - a)
    al = a - ah
    t = 134217729.0 * b
    bh = t - (t - b)
    bl = b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@njit(cache=True, no_cfunc_wrapper=True)
def dd_add(ah, al, bh, bl):
    """Sum of two double-doubles."""
    s, e = two_sum(ah, bh)
    t, f = two_sum(al, bl)
    e += t
    h = s + e
    e = e - (h - s) + f
    r = h + e
    return r, e - (r - h)


@njit(cache=True, no_cfunc_wrapper=True)
def dd_mul(ah, al, bh, bl):
    """Product of two double-doubles."""
    p, e = two_product(ah, bh)
    e += ah * bl + al * bh
    h = p + e
    return h, e - (h - p)


@njit(cache=True, no_cfunc_wrapper=True)
def dd_sqrt(ah, al):
    """Square root of a non-negative double-double."""
    if ah <= 0.0:
        return 0.0, 0.0
    r = math.sqrt(ah)
    p, e = two_product(r, r)
    dh, dl = dd_add(ah, al, -p, -e)
    c = (dh + dl) / (2.0 * r)
    h = r + c
    return h, c - (h - r)


@njit(cache=True, no_cfunc_wrapper=True)
def dd_sin_cos(angle):
    """sin and cos of a double as double-doubles (sin hi, sin lo, cos hi, cos lo); |angle| up to about 1e6."""
    n = math.floor(angle / _HALF_PI[0] + 0.5)
    p, e = two_product(n, _HALF_PI[0])
    rh, rl = dd_add(angle, 0.0, -p, -e)
    p, e = two_product(n, _HALF_PI[1])
    rh, rl = dd_add(rh, rl, -p, -e)
    rh, rl = dd_add(rh, rl, -n * _HALF_PI[2], 0.0)
    rh *= 0.125
    rl *= 0.125
    xh, xl = dd_mul(rh, rl, rh, rl)
    # sin(r)/r and (1 − cos r)/r² by Horner, then three doublings of (sin, 1 − cos).
    sh, sl = _INV_FACT_HI[21], _INV_FACT_LO[21]
    vh, vl = _INV_FACT_HI[22], _INV_FACT_LO[22]
    for i in range(10):
        sh, sl = dd_mul(-sh, -sl, xh, xl)
        sh, sl = dd_add(sh, sl, _INV_FACT_HI[19 - 2 * i], _INV_FACT_LO[19 - 2 * i])
        vh, vl = dd_mul(-vh, -vl, xh, xl)
        vh, vl = dd_add(vh, vl, _INV_FACT_HI[20 - 2 * i], _INV_FACT_LO[20 - 2 * i])
    sh, sl = dd_mul(sh, sl, rh, rl)
    vh, vl = dd_mul(vh, vl, xh, xl)
    for _ in range(3):
        ch, cl = dd_add(1.0, 0.0, -vh, -vl)
        vh, vl = dd_mul(sh, sl, sh, sl)
        vh *= 2.0
        vl *= 2.0
        sh, sl = dd_mul(sh, sl, ch, cl)
        sh *= 2.0
        sl *= 2.0
    ch, cl = dd_add(1.0, 0.0, -vh, -vl)
    quadrant = int(n) % 4
    if quadrant == 0:
        return sh, sl, ch, cl
    if quadrant == 1:
        return ch, cl, -sh, -sl
    if quadrant == 2:
        return -sh, -sl, -ch, -cl
    return -ch, -cl, sh, sl
