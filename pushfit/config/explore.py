"""What an exploration keeps to, besides elevations and force, which are asked for.

Excluded: how an exploration keeps to it (`pushfit.explore.limits`).
"""

from typing import Annotated

from pydantic import Field, model_validator

from pushfit.config.section import Number, Positive, Section, setting

WholeNumber = Annotated[int, Field(strict=True, ge=0)]
AtLeastOne = Annotated[int, Field(strict=True, ge=1)]
Share = Annotated[float, Field(strict=True, gt=0, le=1)]
Side = tuple[Number, Number]
Box = tuple[Side, Side, Side]


class ExploreSection(Section):
    """What `pushfit next` and `pushfit explore` keep to."""

    theta_step_deg: Positive = setting(
        "step between elevations that are asked for [deg]", default=5.0
    )
    alpha_step_deg: Positive = setting(
        "step between azimuths, which lie within `[reach]` [deg]", default=15.0
    )
    workspace_mm: Box | None = setting(
        "box that the fingertip stays in, [low, high] along x, y and z from the "
        "contact [mm]; absent: no box",
        example=[[-4.0, 4.0], [-4.0, 4.0], [0.0, 5.0]],
    )
    rest_s: Positive = setting(
        "least rest before a push and after it, in which the sensor is read [s]",
        default=0.5,
    )
    baseline_sigmas: Positive = setting(
        "how far the reading may be after a push from what it was before, in "
        "standard deviations of a height",
        default=6.0,
    )
    reference_first: AtLeastOne = setting(
        "pushes after which the strongest is made again, to see whether the object "
        "has moved",
        default=4,
    )
    reference_every: WholeNumber = setting(
        "pushes after which that is done again; 0: never, not even first", default=10
    )
    reference_sigmas: Positive = setting(
        "change of its height that says so, in standard deviations", default=5.0
    )
    stall_share: Share = setting(
        "share of a push that may be missing where it ends", default=0.1
    )
    stale_s: Positive = setting(
        "longest silence of the sensor during a push [s]", default=0.5
    )
    max_failures: AtLeastOne = setting(
        "failed pushes in a row that end an exploration", default=3
    )
    max_pushes: AtLeastOne = setting(
        "cap on all pushes, failed ones included", default=300
    )

    @model_validator(mode="after")
    def check_box(self) -> "ExploreSection":
        """Refuse a box that is empty or leaves the contact out."""
        for axis, (low, high) in zip("xyz", self.workspace_mm or (), strict=False):
            if not low <= 0 <= high or low == high:
                raise ValueError(
                    f"workspace_mm has [{low:g}, {high:g}] along {axis}: give "
                    "[low, high] with low <= 0 <= high around the contact"
                )
        return self
