"""Linear algebra of matrices of a few rows, column by column.

Thousands of them are solved side by side; LAPACK would take one at a time. Excluded:
anything larger than a dozen rows, and pivoting.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.model import Scalar
from pushfit.parameters import TINY

# Share of a diagonal entry that is left of it at least: rounding makes singular
# information slightly indefinite.
FLOOR = 1e-14

Matrix = Float[Array, "q q"]
Column = Float[Array, " q"]


def cholesky(matrix: Matrix) -> Matrix:
    """Lower factor L of a positive definite matrix, L Lᵀ.

    Args:
        matrix: Symmetric; directions without information are given next to none.
    """
    q, rest, columns = matrix.shape[0], matrix, []
    for j in range(q):
        tiny = FLOOR * jnp.abs(matrix[j, j]) + TINY
        pivot = jnp.sqrt(jnp.maximum(rest[j, j], tiny))
        column = jnp.where(np.arange(q) > j, rest[:, j] / pivot, 0.0)
        column = column.at[j].set(pivot)
        columns.append(column)
        rest = rest - column[:, None] * column[None]
    return jnp.stack(columns, axis=1) if columns else matrix


def half_solve(factor: Matrix, vector: Column) -> Column:
    """Solution of L x = b."""
    found = []
    for j in range(vector.size):
        found.append(vector[j] / factor[j, j])
        vector = vector - found[j] * factor[:, j]
    return jnp.stack(found) if found else vector


def back_solve(factor: Matrix, vector: Column) -> Column:
    """Solution of Lᵀ x = b: a standard normal b gives the covariance (L Lᵀ)⁻¹."""
    found: list[Scalar] = []
    for j in reversed(range(vector.size)):
        found.append(vector[j] / factor[j, j])
        vector = vector - found[-1] * factor[j]
    return jnp.stack(found[::-1]) if found else vector


def solve(factor: Matrix, vector: Column) -> Column:
    """Solution of L Lᵀ x = b."""
    return back_solve(factor, half_solve(factor, vector))


def log_diagonal(factor: Matrix) -> Scalar:
    """Half the log determinant of L Lᵀ."""
    return jnp.sum(jnp.log(jnp.diag(factor)))


def squared_length(factor: Matrix, vector: Column) -> Scalar:
    """xᵀ L Lᵀ x."""
    return jnp.sum((factor.T @ vector) ** 2)
