"""How far numbers may be apart that are equal but for rounding, or for chance.

Excluded: what physics, a solver or one design allow: with its reason in each test.
"""

ROUNDING = 1e-15  # one multiplication and one division of float64
FEW_OPERATIONS = 1e-13  # equal on paper, after a few operations of float64
EXACT = 1e-12  # equal on paper: a few ulp per operation
ROUTES = 1e-10  # two implementations, or the same operations in another order
DIFFERENCE = 1e-6  # autodiff against central differences
MAX_Z = 4.0  # standard errors: of a normal, two-sided, a false alarm is 6e-5
