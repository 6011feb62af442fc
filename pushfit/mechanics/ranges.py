"""Numbers that callers give, and what they may be.

Millimetres for metres, or degrees for radians, would give numbers without a meaning.
Excluded: types (`pushfit.arguments`), cells of tables, and settings.
"""

import math
import sys
from collections.abc import Iterable
from typing import Any

import numpy as np

from pushfit.errors import ConfigError
from pushfit.parameters import SIX

# The least number above 0, and the largest.
ABOVE_ZERO, LARGEST = sys.float_info.min, sys.float_info.max
# Of angles that are computed [rad].
ROUNDING = 1e-6
# Fields, the least and the largest number that they may be, and the rule.
Range = tuple[Iterable[str], float, float, str]
METRES = "and at most 1, in metres; 5 mm are 0.005"
OF_CONTACT: tuple[Range, ...] = (
    ([name for name in SIX if name != "C_rr"], ABOVE_ZERO, LARGEST, "above 0"),
    (["C_rr"], 0.0, LARGEST, "0 or above"),
)
OF_GRASP: tuple[Range, ...] = (
    (["push_length"], ABOVE_ZERO, 1.0, f"above 0 {METRES}"),
    (["preload"], 0.0, LARGEST, "0 or above"),
    (["gain"], ABOVE_ZERO, LARGEST, "above 0"),
    (["offset"], -LARGEST, LARGEST, "a finite number"),
    (["sharpness"], 1.0, math.inf, "1 or above; `math.inf` is a hard transition"),
    (["support_span"], ABOVE_ZERO, math.inf, "above 0"),
    (["tip_radius"], 0.0, 1.0, f"0 or above, {METRES}"),
)


def check_fields(record: object, ranges: Iterable[Range]) -> None:
    """Refuse a record in which a number is out of its range; None is no number.

    Raises:
        ConfigError: As by `check_numbers`, named by the class and the field.
    """
    for names, low, high, rule in ranges:
        for name in names:
            if (value := getattr(record, name)) is not None:
                place = f"{type(record).__name__}: {name}"
                check_numbers(place, value, low=low, high=high, rule=rule)


def check_numbers(
    place: str, values: object, *, low: float, high: float, rule: str
) -> None:
    """Refuse what is no number of a range, its ends included; NaN is in none.

    Args:
        place: What a message calls them.
        values: One number or many; what is traced passes.
        low: Least of them.
        high: Largest of them.
        rule: What they must be, and what to give.

    Raises:
        ConfigError: By the place, the first value outside, and the rule.
    """
    # Slow to load, and nothing is traced without it.
    core = sys.modules.get("jax.core")
    if core is not None and isinstance(values, core.Tracer):
        return
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
    check_numbers(place, values, low=-most - ROUNDING, high=most + ROUNDING, rule=rule)


def check_together(place: str, **arrays: Any) -> None:
    """Refuse arrays of which one number cannot be taken with one of each other.

    Args:
        place: What a message calls what they are for.
        arrays: What belongs together, by name.

    Raises:
        ConfigError: By the names and their shapes.
    """
    shapes = {name: np.shape(values) for name, values in arrays.items()}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        found = " and ".join(f"{name} of {shape}" for name, shape in shapes.items())
        raise ConfigError(
            f"{place}: shapes {found} do not go together; give as many numbers of "
            "each, or one for all",
            code="input_shape",
        ) from None
