"""θ_c with its interval by lmfit: best fit, then its emcee.

The equations of the paper, in the three combinations that these heights depend on.
"""

import lmfit
import numpy as np
import pandas as pd

table = pd.read_csv("heights.csv")
push_length = 0.005


def heights(theta, A, B, C_rr):
    """Eqs. (12) to (14) of He & Zhang (2014) [N]."""
    normal = A * push_length * np.sin(theta)
    tangential = np.minimum(C_rr * normal, B * push_length * np.cos(theta))
    return np.hypot(normal, tangential)


model = lmfit.Model(heights)
start = model.make_params(
    A={"value": 670.0, "min": 1.0, "max": 1e5},
    B={"value": 195.0, "min": 1.0, "max": 1e5},
    C_rr={"value": 0.3, "min": 0.001, "max": 10.0},
)
given = {
    "data": table["height_n"].to_numpy(),
    "theta": np.radians(table["theta_deg"].to_numpy()),
    "weights": 1 / table["height_sd_n"].to_numpy(),
}
best = model.fit(params=start, **given)
print(best.fit_report())
options = {"steps": 2000, "burn": 500, "is_weighted": True, "seed": 1}
chain = model.fit(
    params=best.params, method="emcee", fit_kws=options | {"progress": False}, **given
)
draws = chain.flatchain
theta_c = np.degrees(np.arctan2(draws["B"], draws["C_rr"] * draws["A"]))
low, middle, high = np.quantile(theta_c, [0.05, 0.5, 0.95])
print(f"theta_c = {middle:.1f} ({low:.1f} to {high:.1f})")
