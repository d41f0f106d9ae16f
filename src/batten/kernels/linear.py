"""Small dense linear algebra, in place."""

import math

from numba import njit


@njit(cache=True, no_cfunc_wrapper=True)
def copy(source, target):
    """source[i] into target[i], for shape (n,): as `target[:] = source`, which takes a second and a half to compile."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@njit(cache=True, no_cfunc_wrapper=True)
def solve_linear(matrix, rhs, n):
    """Solve the leading n × n system by elimination with partial pivoting; the answer is in rhs. False if singular."""
    for i in range(n):
        pivot, row = abs(matrix[i, i]), i
        for j in range(i + 1, n):
            if abs(matrix[j, i]) > pivot:
                pivot, row = abs(matrix[j, i]), j
        if not pivot > 1e-300:
            return False
        if row != i:
            for k in range(n):
                matrix[i, k], matrix[row, k] = matrix[row, k], matrix[i, k]
            rhs[i], rhs[row] = rhs[row], rhs[i]
        inv = 1.0 / matrix[i, i]
        for j in range(i + 1, n):
            f = matrix[j, i] * inv
            if f != 0.0:
                for k in range(i, n):
                    matrix[j, k] -= f * matrix[i, k]
                rhs[j] -= f * rhs[i]
    for i in range(n - 1, -1, -1):
        total = rhs[i]
        for k in range(i + 1, n):
            total -= matrix[i, k] * rhs[k]
        rhs[i] = total / matrix[i, i]
    return True


@njit(cache=True, no_cfunc_wrapper=True)
def eigen_symmetric(matrix, vectors, values, n):
    """Eigenvalues and orthonormal eigenvectors (columns) of a symmetric matrix by Jacobi rotations; `matrix` is lost."""
    for i in range(n):
        for j in range(n):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(30):
        off, diagonal = 0.0, 0.0
        for i in range(n):
            diagonal += matrix[i, i] * matrix[i, i]
            for j in range(i):
                off += matrix[i, j] * matrix[i, j]
        if off <= 1e-28 * diagonal:
            break
        for p in range(n - 1):
            for q in range(p + 1, n):
                apq = matrix[p, q]
                if apq == 0.0:
                    continue
                h = 0.5 * (matrix[q, q] - matrix[p, p]) / apq
                t = 1.0 / (abs(h) + math.sqrt(1.0 + h * h))
                if h < 0.0:
                    t = -t
                c = 1.0 / math.sqrt(1.0 + t * t)
                s = t * c
                for k in range(n):
                    x, y = matrix[k, p], matrix[k, q]
                    matrix[k, p], matrix[k, q] = c * x - s * y, s * x + c * y
                for k in range(n):
                    x, y = matrix[p, k], matrix[q, k]
                    matrix[p, k], matrix[q, k] = c * x - s * y, s * x + c * y
                for k in range(n):
                    x, y = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * x - s * y, s * x + c * y
    for i in range(n):
        values[i] = matrix[i, i]
