"""Linear algebra of matrices of a few rows, entry by entry.

Thousands of them are solved side by side; LAPACK would take one at a time. Excluded:
anything larger than a dozen rows, and pivoting.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from pushfit.model import Scalar

# Rows of a lower triangular factor, each up to its diagonal.
Factor = list[list[Scalar]]
# Share of a diagonal entry that is left of it at least: rounding makes singular
# information slightly indefinite.
FLOOR = 1e-14


def cholesky(matrix: Float[Array, "q q"]) -> Factor:
    """Lower factor L of a positive definite matrix, L Lᵀ.

    Args:
        matrix: Symmetric; directions without information are given next to none.
    """
    factor: Factor = []
    for i in range(matrix.shape[0]):
        row: list[Scalar] = []
        for j in range(i):
            rest = matrix[i, j] - _dot(row, factor[j][:j])
            row.append(rest / factor[j][j])
        rest = matrix[i, i] - _dot(row, row)
        tiny = FLOOR * jnp.abs(matrix[i, i]) + 1e-300
        factor.append([*row, jnp.sqrt(jnp.maximum(rest, tiny))])
    return factor


def half_solve(factor: Factor, vector: Float[Array, " q"]) -> list[Scalar]:
    """Solution of L x = b."""
    found: list[Scalar] = []
    for i, row in enumerate(factor):
        found.append((vector[i] - _dot(row[:i], found)) / row[i])
    return found


def back_solve(factor: Factor, vector: list[Scalar] | Float[Array, " q"]) -> Array:
    """Solution of Lᵀ x = b: a standard normal b gives the covariance (L Lᵀ)⁻¹."""
    q = len(factor)
    found: list[Scalar] = [jnp.zeros(())] * q
    for i in reversed(range(q)):
        column = [factor[k][i] for k in range(i + 1, q)]
        found[i] = (vector[i] - _dot(column, found[i + 1 :])) / factor[i][i]
    return jnp.stack(found) if found else jnp.zeros(0)


def solve(factor: Factor, vector: Float[Array, " q"]) -> Float[Array, " q"]:
    """Solution of L Lᵀ x = b."""
    return back_solve(factor, half_solve(factor, vector))


def log_diagonal(factor: Factor) -> Scalar:
    """Half the log determinant of L Lᵀ."""
    total = jnp.zeros(())
    for row in factor:
        total = total + jnp.log(row[-1])
    return total


def squared_length(factor: Factor, vector: Float[Array, " q"]) -> Scalar:
    """xᵀ L Lᵀ x."""
    total = jnp.zeros(())
    for i in range(len(factor)):
        column = [factor[k][i] for k in range(i, len(factor))]
        entry = _dot(column, [vector[k] for k in range(i, len(factor))])
        total = total + entry**2
    return total


def _dot(a: list[Scalar], b: list[Scalar]) -> Scalar:
    total = jnp.zeros(())
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total
