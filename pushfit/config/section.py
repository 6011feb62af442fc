"""What all sections of `grasp.toml` have in common.

Excluded: the sections (`pushfit.config.schema`).
"""

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

# TOML tells numbers, strings and booleans apart, so "5" and true are no numbers here.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
# Of a push by a hand: metres or micrometres would lie outside.
Millimetres = Annotated[
    float, Field(strict=True, allow_inf_nan=False, ge=0.01, le=1000.0)
]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
NotBelowOne = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1)]
Probability = Annotated[float, Field(strict=True, gt=0, lt=1)]


def _elevations(ends: tuple[float, float]) -> tuple[float, float]:
    """Refuse a range of elevations that is empty or passes the normal."""
    low, high = ends
    if not -90.0 <= low <= high <= 90.0:
        raise ValueError("give [low, high] with -90 <= low <= high <= 90")
    return ends


Elevations = Annotated[tuple[Number, Number], AfterValidator(_elevations)]
# The paper's finger goes to 60°; the sine, which everything needs, is near 0 below 5°.
ELEVATIONS = (5.0, 85.0)


class Section(BaseModel):
    """A table of the file: unknown keys are errors, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def setting(description: str, *, default: Any = None, example: Any = None) -> Any:
    """A key of a section.

    Args:
        example: What a template shows behind a '#', where the default has no effect.
    """
    examples = None if example is None else [example]
    return Field(default=default, description=description, examples=examples)
