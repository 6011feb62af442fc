"""θ_c with its interval by emcee, with the convergence checks of ArviZ.

The equations of the paper, in the three combinations that these heights depend on.
"""

import arviz_base
import arviz_stats
import emcee
import numpy as np
import pandas as pd

table = pd.read_csv("heights.csv")
push_length = 0.005
theta = np.radians(table["theta_deg"].to_numpy())
height, sd = table["height_n"].to_numpy(), table["height_sd_n"].to_numpy()
low, high = np.log([1.0, 1.0, 0.001]), np.log([1e5, 1e5, 10.0])


def log_prob(x):
    """Flat priors in the logs, normal noise."""
    if np.any(x < low) or np.any(x > high):
        return -np.inf
    A, B, C_rr = np.exp(x)
    normal = A * push_length * np.sin(theta)
    tangential = np.minimum(C_rr * normal, B * push_length * np.cos(theta))
    return -0.5 * np.sum(((np.hypot(normal, tangential) - height) / sd) ** 2)


rng = np.random.default_rng(1)
start = np.log([670.0, 195.0, 0.3]) + 0.05 * rng.normal(size=(32, 3))
sampler = emcee.EnsembleSampler(32, 3, log_prob)
sampler.run_mcmc(start, 2500)
A, B, C_rr = np.exp(sampler.get_chain(discard=500).transpose(2, 1, 0))
theta_c = np.degrees(np.arctan2(B, C_rr * A))
tree = arviz_base.from_dict(
    {"posterior": {"A": A, "B": B, "C_rr": C_rr, "theta_c": theta_c}}
)
print(arviz_stats.summary(tree, ci_kind="eti", ci_prob=0.9))
ends = np.quantile(theta_c, [0.05, 0.5, 0.95])
print(f"theta_c = {ends[1]:.1f} ({ends[0]:.1f} to {ends[2]:.1f})")
