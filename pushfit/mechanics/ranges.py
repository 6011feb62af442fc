"""Numbers that callers give, and what they may be.

Millimetres for metres, or degrees for radians, would give numbers without a meaning.
Excluded: types (`pushfit.arguments`), cells of tables, and settings.
"""

import sys

import numpy as np

from pushfit.errors import ConfigError

# The least number above 0, and the largest.
ABOVE_ZERO, LARGEST = sys.float_info.min, sys.float_info.max
# Of angles that are computed [rad].
ROUNDING = 1e-6


def check_numbers(
    place: str, values: object, low: float, high: float, *, rule: str
) -> None:
    """Refuse what is no number of a range, its ends included; NaN is in none.

    Args:
        place: What a message calls them.
        values: One number or many.
        low: Least of them.
        high: Largest of them.
        rule: What they must be, and what to give.

    Raises:
        ConfigError: By the place, the first value outside, and the rule.
    """
    try:
        given = np.atleast_1d(np.asarray(values))
        # Of text too NumPy would make numbers.
        is_text = given.dtype.kind == "U"
        numbers = given.astype(float, casting="no" if is_text else "unsafe")
    except (TypeError, ValueError):
        shown, rule = repr(values), f"a number, {rule}"
    else:
        outside = numbers[~((low <= numbers) & (numbers <= high))]
        if not outside.size:
            return
        shown = f"{outside[0]:g}"
    raise ConfigError(f"{place} = {shown}: must be {rule}", code="input_range")


def check_angles(place: str, values: object, *, most: float) -> None:
    """Refuse angles that are too large, as those in degrees mostly are.

    Args:
        place: What a message calls them.
        values: One angle or many [rad].
        most: Largest of them, either way [rad].

    Raises:
        ConfigError: By the place, the first angle beyond, and the rule.
    """
    rule = (
        f"in radians, from -{most:.4g} to {most:.4g}; `numpy.radians` makes it of "
        "degrees"
    )
    check_numbers(place, values, -most - ROUNDING, most + ROUNDING, rule=rule)
