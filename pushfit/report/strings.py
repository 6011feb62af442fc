"""Words and numbers as a reader sees them: units, symbols, significant digits.

Text that came from a user (paths, notes, column names) passes through `printable`
before it reaches a terminal, a page or a figure. Excluded: words on a result
(`pushfit.report.answers`, `pushfit.report.fact_rows`).
"""

import math
import re
import unicodedata
from collections.abc import Sequence
from functools import partial

from pushfit.parameters import HALF_TURN, named

# Words of units in tables and in `Quantity.unit` on the left, as printed on the right.
UNITS = {"deg": "°", "n": "N", "kpa": "kPa", "au": "a.u."}
NO_UNIT = frozenset({"", "-", "–", "1"})

# The largest uncertainty that still shows whole degrees (two digits of it).
COARSE_DEG = 99.0
# And never finer than a hundredth of one.
FINE_DEG = 0.1

# Below this share of a run what is left would be a guess.
FORESEEABLE = 0.15

# Control, format (bidirectional overrides among them), surrogate and private characters
# can rewrite a terminal line or break an encoder.
UNSAFE_CATEGORIES = frozenset({"Cc", "Cf", "Cs", "Co", "Cn"})


def printable(text: str) -> str:
    r"""Text in which nothing can move the cursor, change colour or hide itself.

    Returns:
        The text with every control or format character as its escape, on one line.

    Examples:
        >>> printable("a\x1b[31mb")
        'a\\x1b[31mb'
    """
    if text.isprintable():  # at once, whatever its length
        return text
    return "".join(
        ascii(char)[1:-1] if unicodedata.category(char) in UNSAFE_CATEGORIES else char
        for char in text
    )


def unit_label(unit: str) -> str:
    """Unit as printed, "kPa·m/rad" for "kpa·m/rad"; empty for a pure number."""
    if unit in NO_UNIT:
        return ""
    words = re.compile(r"[A-Za-z]+")
    return words.sub(lambda m: UNITS.get(m[0].lower(), m[0]), printable(unit))


def symbol(name: str) -> str:
    """Letter of a quantity in prose, the name itself if it has none."""
    record = named(name)
    return printable(record.prose if record else name)


def format_number(value: float | None, *, spread: float | None = None) -> str:
    """Number with the digits that its uncertainty justifies.

    Args:
        spread: Its uncertainty in the same unit; three digits if there is none.

    Returns:
        Plain decimals, powers of ten beyond six places, "unknown" for None and NaN.

    Examples:
        >>> format_number(40.1234, spread=4.5)
        '40.1'
        >>> format_number(52341.0, spread=3000.0)
        '52300'
    """
    if value is None or math.isnan(value):
        return "unknown"
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if spread is None or not (math.isfinite(spread) and spread > 0):
        spread = abs(value) / 10 or 10.0
    # Two digits of the spread, rounded first: 0.996 counts as 1.0 and not as 0.99.
    decimals = 1 - math.floor(math.log10(float(f"{spread:.1e}")))
    rounded = round(value, decimals) + 0.0  # + 0.0: never "-0"
    size = abs(rounded)
    if size != 0 and not 1e-4 <= size < 1e7:
        # Digits before the point of the mantissa plus those that the spread allows.
        digits = max(0, math.floor(math.log10(size)) + decimals)
        return f"{rounded:.{digits}e}"
    return f"{rounded:.{max(decimals, 0)}f}"


def with_unit(number: str, unit: str) -> str:
    """Number and unit, "40°" without and "3 N" with a space."""
    label = unit_label(unit)
    if not label:
        return number
    return f"{number}{label}" if label == "°" else f"{number} {label}"


def format_angle(value: float, *, spread: float = 10.0) -> str:
    """Angle in degrees with the digits that its uncertainty justifies.

    Args:
        value: The angle [deg].
        spread: Its uncertainty [deg]; from whole degrees to hundredths.
    """
    spread = min(max(spread, FINE_DEG), COARSE_DEG)
    return f"{format_number(value, spread=spread)}°"


def spread_of(estimate: float, interval: tuple[float, float]) -> float:
    """Width that decides the digits of an estimate and its interval.

    Twice the shorter arm, so that the near end of a skewed interval keeps its digits.

    Examples:
        >>> spread_of(10.0, (9.0, 13.0))
        2.0
    """
    low, high = interval
    arm = min(estimate - low, high - estimate)
    return 2 * arm if arm > 0 else high - low


def format_estimate(
    estimate: float, interval: tuple[float, float], unit: str, *, is_axis: bool = False
) -> tuple[str, str]:
    """Number, with its unit only where that is degrees, and interval in words.

    Args:
        estimate: Of an axis also as of an interval across its end, 183° for 3°.
        is_axis: Whether 180° is 0°.
    """
    within = estimate
    if is_axis:
        within += HALF_TURN * (estimate < interval[0])
        estimate -= HALF_TURN * (estimate > HALF_TURN)
    spread = spread_of(within, interval)
    number = format_number(estimate, spread=spread)
    if unit_label(unit) == "°":
        number = format_angle(estimate, spread=spread)
    return number, format_range(*interval, unit, spread=spread, is_axis=is_axis)


def format_range(
    lower: float | None,
    upper: float | None,
    unit: str,
    *,
    spread: float | None = None,
    is_axis: bool = False,
) -> str:
    """Interval or half-open set in words: "38° to 42°", "above 61°", "below 20°".

    Args:
        spread: Uncertainty that decides the digits; None is the width.
        is_axis: Whether 180° is 0°.
    """
    is_angle = unit_label(unit) == "°"
    if lower is None or upper is None:
        end = lower if upper is None else upper
        if end is None:
            return "any value"
        # Whole degrees, otherwise three digits.
        bound = format_angle(end) if is_angle else with_unit(format_number(end), unit)
        return f"{'above' if upper is None else 'below'} {bound}"
    spread = upper - lower if spread is None else spread
    if is_angle:
        start = format_angle(lower, spread=spread)
        if is_axis and lower < HALF_TURN < upper:
            start, upper = f"{start} to 180° and on", upper - HALF_TURN
        return f"{start} to {format_angle(upper, spread=spread)}"
    low, high = (format_number(end, spread=spread) for end in (lower, upper))
    return with_unit(f"{low} to {high}", unit)


def time_left(share: float, seconds: float) -> str:
    """Words for what is left of a run, ", about 9 s left"; none where it is a guess.

    Args:
        share: What is done of it.
        seconds: Time that this took [s].
    """
    if not FORESEEABLE <= share < 1:
        return ""
    return f", about {seconds * (1 - share) / share:.0f} s left"


def format_p_value(p_value: float) -> str:
    """Probability as a relation: "< 0.001" or "= 0.46"."""
    return "< 0.001" if p_value < 1e-3 else f"= {p_value:.2g}"


def _join(items: Sequence[str], *, word: str) -> str:
    """Items in a sentence: "a", "a or b", "a, b or c"."""
    if len(items) < 2:
        return "".join(items)
    return f"{', '.join(items[:-1])} {word} {items[-1]}"


join_or, join_and = partial(_join, word="or"), partial(_join, word="and")
