"""θ_c with its interval by pushfit, all else that it says included."""

import pushfit

result = pushfit.identify("heights.csv", config={"push": {"length_mm": 5.0}})
print(result.summary())
low, high = result.theta_c.interval
print(f"theta_c = {float(result.theta_c):.1f} ({low:.1f} to {high:.1f})")
