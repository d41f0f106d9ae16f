"""Small linear algebra against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from batten.kernels.linear import eigen_symmetric, solve_linear


@pytest.mark.parametrize("n", [1, 2, 4, 6])
def test_linear_systems_are_solved(n):
    random = np.random.default_rng(n)
    for _ in range(20):
        matrix, rhs = random.normal(size=(6, 6)), random.normal(size=6)
        expected = np.linalg.solve(matrix[:n, :n], rhs[:n])
        rest, beyond = rhs[n:].copy(), matrix[n:].copy()
        backward = 1e-14 * np.linalg.cond(matrix[:n, :n]) * np.abs(expected).max()
        assert solve_linear(matrix, rhs, n)
        np.testing.assert_allclose(rhs[:n], expected, rtol=0, atol=backward)
        assert (rhs[n:] == rest).all()  # only the leading block takes part
        assert (matrix[n:] == beyond).all()


def test_rows_are_exchanged_where_a_pivot_is_zero():
    matrix, rhs = np.array([[0.0, 2.0], [4.0, 0.0]]), np.array([6.0, 8.0])
    assert solve_linear(matrix, rhs, 2)
    assert rhs.tolist() == [2.0, 3.0]


@pytest.mark.parametrize("matrix", [np.zeros((2, 2)), np.ones((2, 2)), np.full((2, 2), np.nan)])
def test_singular_systems_are_refused(matrix):
    assert not solve_linear(matrix.copy(), np.ones(2), 2)


@pytest.mark.parametrize("n", [1, 2, 3, 7])
def test_eigenvalues_and_vectors(n):
    random = np.random.default_rng(n)
    for scale in (1.0, 1e-12, 1e12):
        root = random.normal(size=(n, n)) * np.logspace(0, -3, n)
        matrix = (root + root.T) * scale
        values, vectors = np.empty(n), np.empty((n, n))
        eigen_symmetric(matrix.copy(), vectors, values, n)
        np.testing.assert_allclose(vectors.T @ vectors, np.eye(n), atol=1e-14)
        np.testing.assert_allclose(vectors * values @ vectors.T, matrix, atol=1e-13 * np.abs(matrix).max())
        np.testing.assert_allclose(np.sort(values), np.linalg.eigvalsh(matrix), atol=1e-13 * np.abs(matrix).max())


def test_a_matrix_of_rank_one_keeps_its_null_space():
    v = np.array([3.0, -4.0, 12.0]) / 13.0
    values, vectors = np.empty(3), np.empty((3, 3))
    eigen_symmetric(np.outer(v, v), vectors, values, 3)
    assert np.sort(values) == pytest.approx([0.0, 0.0, 1.0], abs=1e-15)
    assert abs(vectors[:, np.argmax(values)] @ v) == pytest.approx(1.0, abs=1e-15)
