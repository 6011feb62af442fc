"""Points from which least squares begins: few, but decades and shapes apart.

Excluded: the polish of these points (`pushfit.fit.profiles.least_squares`).
"""

import itertools

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from pushfit.fit.problem.constraint_terms import held_values
from pushfit.fit.problem.problem import Problem
from pushfit.fit.sweep.outer_nodes import SHAPES
from pushfit.mechanics.combinations import contact

# C_rr, or B/A where C_rr follows from θ_c: their basins are decades wide.
RATIOS = np.log([0.03, 0.3, 3.0])
# F_0 as a share of the largest force: small, and most of it.
LN_F_0 = (-2.0, -0.3)
# s = K_st L²/C_d where it stands for B: the finger shears, does both, or bends.
LN_S = (-3.0, 0.0, 3.0)


def guesses(problem: Problem) -> Float[np.ndarray, "k q"]:
    """Data coordinates to begin with; scale and θ_c are left to who tries them."""
    names = problem.data_names
    force = float(np.max(np.abs(np.asarray(problem.observed))))
    force /= float(problem.grasp.gain)
    ln_A = np.log(force / float(problem.grasp.push_length))
    if "ln_A" not in names:
        group = contact(problem.data_state(jnp.zeros(len(names))).params)
        ln_A = float(jnp.log(group.A))
    ln_L = 0.0
    if "ln_L" in names:
        draws = problem.priors["L"].sample(np.random.default_rng(0), 999)
        ln_L = float(np.median(draws))
    tried = itertools.product(
        RATIOS if {"ln_B", "ln_C_rr"} & set(names) else RATIOS[:1],
        SHAPES if "f1" in names else SHAPES[:1],
        LN_F_0 if "ln_F_0" in names else LN_F_0[:1],
        LN_S if "ln_s" in names and "ln_B" not in names else (0.0,),
    )
    points = []
    for ratio, (f1, f2), ln_F_0, ln_s in tried:
        values = {
            "ln_A": ln_A,
            "ln_B": ln_A + ratio,
            "ln_C_rr": ratio,
            "f1": f1,
            "f2": f2,
            "ln_F_0": np.log(force) + ln_F_0,
            "ln_s": ln_s,
            "ln_L": ln_L,
            "ln_p": 0.0,
        }
        points.append([values[name] for name in names])
    return held_values(problem, np.array(points))
