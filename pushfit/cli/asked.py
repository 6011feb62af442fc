"""What is asked of an exploration, as options of `next` and `explore`.

Excluded: the commands (`pushfit.cli.commands.explore`).
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pushfit.cli import options
from pushfit.errors import ConfigError
from pushfit.parameters import SensorUnit

if TYPE_CHECKING:
    from pushfit.config import GraspConfig
    from pushfit.explore.explorer import Explorer
    from pushfit.fit.identify.progress import Stages

COMPONENTS = ("height_normal", "height_tangential")

UnitOption = Annotated[
    SensorUnit | None,
    typer.Option(
        help="Unit of the sensor, where no table says it; left out, that of the "
        "preload, or else n."
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What is asked of an exploration, and the limits that it keeps to."""

    config: options.ConfigFile = None
    ask: Annotated[
        Literal["theta_c", "alpha_star", "both"],
        typer.Option(help="The angle that pushes are to tell of."),
    ] = "theta_c"
    width: Annotated[
        float, typer.Option(metavar="DEG", help="Width that decides: 6 is ± 3 degrees.")
    ] = 6.0
    budget: Annotated[int, typer.Option(min=1, help="Pushes that may be made.")] = 60
    sigma: Annotated[
        float | None,
        typer.Option(
            help="Scatter of the heights of equal pushes [unit of the heights]."
        ),
    ] = None
    theta: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="LOW HIGH",
            help="Elevations that the finger can push in; left out, those of [reach].",
        ),
    ] = None
    max_force: Annotated[
        float | None,
        typer.Option(
            "--max-force",
            help="No push that might exceed it, preload included "
            "[N, or the unit of uncalibrated heights].",
        ),
    ] = None
    forces: Annotated[
        bool,
        typer.Option(
            "--forces",
            help="The sensor gives force components, as with [peaks] normal.",
        ),
    ] = False

    def reaching(self, settings: "GraspConfig") -> "GraspConfig":
        """Settings with the elevations of the option, if it is given."""
        if self.theta is None:
            return settings
        return settings.with_keys("reach", theta_deg=self.theta)

    def has_forces(self, settings: "GraspConfig") -> bool:
        """Whether heights come as components: by the option, or by the settings."""
        return self.forces or settings.peaks.normal is not None

    def explorer(
        self,
        settings: "GraspConfig",
        *,
        channels: tuple[str, ...] | None = None,
        unit: str,
        seed: int,
        journal: Path | None = None,
        stages: "Stages | None" = None,
        hand: dict[str, object] | None = None,
    ) -> "Explorer":
        """What chooses the pushes.

        Args:
            channels: Those of a table that was made before.
            stages: Hears what is done until something is believed.
            hand: What the journal is to be gone on with.
        """
        from pushfit.explore.belief.from_fit import believe
        from pushfit.explore.explorer import Explorer
        from pushfit.explore.limits import Limits

        return Explorer(
            settings,
            ask=self.ask,
            width_deg=self.width,
            budget=self.budget,
            sigma=self.sigma,
            limits=Limits.of(settings, force=self.max_force),
            channels=channels
            or (COMPONENTS if self.has_forces(settings) else ("height",)),
            unit=unit,
            journal=journal,
            seed=seed,
            source=partial(believe, stages=stages),
            hand=hand,
        )


def sensor_unit(*settings: "GraspConfig", stated: SensorUnit | None) -> str:
    """Unit of a sensor that no table tells of: as stated, or that of a preload."""
    of_preload = [*filter(None, (one.grasp.preload[1] for one in settings))]
    if stated is None:
        return next(iter(of_preload), "n")
    same = set(of_preload)
    hint = f", or `unit={same.pop()!r}` for heights in it" if len(same) == 1 else ""
    for one in settings:
        try:
            one.preload_in(stated)
        except ConfigError as error:
            raise type(error)(f"{error}{hint}", code=error.code) from None
    return stated
