"""Conversions between what a sensor reads and newtons, as far as they are known.

Excluded: units of samples and their conversion (`pushfit.data.units`).
"""

import math
from collections.abc import Sequence

from pydantic import model_validator

from pushfit.config.section import Positive, Section, setting

SINGULAR = {"count": "counts"}
# Factors that are stated by two digits, as 7.3 and 0.137, are the same within this.
_ROUNDED = 0.05


class SensorSection(Section):
    """How sensor readings convert; absent: everything stays in the sensor's unit.

    Factors chain: `kpa_per_count` and `n_per_kpa` together turn counts into newtons.
    """

    counts_per_n: Positive | None = setting("counts for one newton", example=200.0)
    n_per_count: Positive | None = setting("newtons for one count", example=0.005)
    kpa_per_n: Positive | None = setting("kilopascals for one newton", example=7.3)
    n_per_kpa: Positive | None = setting("newtons for one kilopascal", example=0.137)
    counts_per_kpa: Positive | None = setting("counts for one kilopascal", example=27.4)
    kpa_per_count: Positive | None = setting(
        "kilopascals for one count", example=0.0365
    )
    au_per_n: Positive | None = setting("arbitrary units for one newton", example=1.5)
    n_per_au: Positive | None = setting("newtons for one arbitrary unit", example=0.67)

    @model_validator(mode="after")
    def check_no_contradiction(self) -> "SensorSection":
        """Refuse a factor that follows from the others, or contradicts them."""
        given = self._factors()
        for name, (source, target, stated) in given.items():
            others = [step for key, step in given.items() if key != name]
            other = _convert(others, source).get(target)
            if other is None:
                continue
            if math.isclose(stated, other, rel_tol=_ROUNDED):
                raise ValueError(f"{name} follows from the other factors; remove it")
            rest = ", ".join(key for key in given if key != name)
            raise ValueError(
                f"{name} = {stated:g} contradicts {rest}, by which it is {other:.4g}; "
                "find out which is wrong and remove it"
            )
        return self

    def factor(self, source: str, target: str) -> float | None:
        """Factor from one unit to the other; None where the file does not say.

        Args:
            source: Unit of the value: n, kpa, counts or au.
        """
        return _convert(list(self._factors().values()), source).get(target)

    def _factors(self) -> dict[str, tuple[str, str, float]]:
        """Keys that are given, each as (from, to, factor)."""
        given = {}
        for name in type(self).model_fields:
            value = getattr(self, name)
            if value is not None:
                target, source = (
                    SINGULAR.get(unit, unit) for unit in name.split("_per_")
                )
                given[name] = (source, target, value)
        return given


def _convert(steps: Sequence[tuple[str, str, float]], source: str) -> dict[str, float]:
    """Factors from one unit to every unit that the steps can reach."""
    both_ways = [*steps, *((b, a, 1 / factor) for a, b, factor in steps)]
    reached = {source: 1.0}
    for _ in steps:
        for start, end, factor in both_ways:
            if start in reached and end not in reached:
                reached[end] = reached[start] * factor
    return reached
