"""How far numbers may be apart that are equal but for rounding.

Excluded: what physics, noise or a solver allow: with its reason in each test.
"""

ROUNDING = 1e-15  # one multiplication and one division of float64
EXACT = 1e-12  # equal on paper: a few ulp per operation
ROUTES = 1e-10  # two implementations, or the same operations in another order
DIFFERENCE = 1e-6  # autodiff against central differences of step ∛eps
