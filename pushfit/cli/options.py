"""Arguments and options that several commands share, and groups of them.

Excluded: options that every command has (`pushfit.cli.session`).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

Recordings = Annotated[
    list[Path],
    typer.Argument(metavar="RECORDING...", help="Recordings, one for each sweep."),
]
RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording.")]
TableFile = Annotated[
    Path, typer.Argument(metavar="TABLE", help="Peak heights, as `peaks` writes them.")
]
Schedules = Annotated[
    list[Path] | None,
    typer.Option(
        "--schedule",
        "-s",
        metavar="S.csv",
        help="Directions of the pushes in their order; once for each recording.",
    ),
]
ScheduleFile = Annotated[
    Path | None,
    typer.Option(
        "--schedule", "-s", metavar="S.csv", help="Directions of the pushes, in order."
    ),
]
ConfigFile = Annotated[
    Path | None,
    typer.Option(
        "--config",
        "-c",
        metavar="grasp.toml",
        help="What is known of grasp and sensor; `pushfit init` writes one.",
    ),
]
OutFolder = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="DIR", help="Folder for result and figures."),
]
Pictures = Annotated[
    Literal["png", "svg"] | None,
    typer.Option("--pictures", help="Every figure also in this format."),
]
ResultFolder = Annotated[
    Path, typer.Option("--out", "-o", metavar="DIR", help="Folder of the results.")
]
OutFile = Annotated[
    Path | None,
    typer.Option(
        *("--out", "-o", "--output"), metavar="FILE", help="File instead of stdout."
    ),
]
PlotFile = Annotated[
    Path | None, typer.Option("--plot", metavar="FILE", help="Picture (png, svg, pdf).")
]
Engine = Annotated[
    Literal["auto", "sweep", "emcee"],
    typer.Option(
        help="Sweep, or sample by emcee; auto: emcee where a sweep falls short."
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of all randomness.")]
JsonOption = Annotated[
    bool, typer.Option("--json", help="One JSON document on stdout.")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite what is there.")]
Profile = Annotated[
    Path | None,
    typer.Option(
        metavar="lab.toml", help="Settings that grasp.toml and the options override."
    ),
]
Invert = Annotated[bool, typer.Option("--invert", help="Pushes lower the signal.")]
Exclude = Annotated[
    list[str] | None,
    typer.Option(metavar="T1:T2", help="Seconds between which humps are no pushes."),
]
Include = Annotated[
    list[str] | None,
    typer.Option(metavar="T1:T2", help="Seconds between which small humps are pushes."),
]
From = Annotated[
    float | None, typer.Option("--from", metavar="T", help="Second to begin at.")
]
To = Annotated[
    float | None, typer.Option("--to", metavar="T", help="Second to end at.")
]


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingsOptions:
    """Files of settings, and what is said over them of how recordings are laid out."""

    config: ConfigFile = None
    profile: Profile = None
    format: Annotated[
        str | None, typer.Option(metavar="NAME", help="Dialect of the recordings.")
    ] = None
    map: Annotated[
        list[str] | None,
        typer.Option(
            metavar="pressure=pdc", help="Column of a channel, of time, theta or alpha."
        ),
    ] = None
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="pressure=counts", help="Unit of a channel or column."),
    ] = None
    columns: Annotated[
        str | None,
        typer.Option(metavar="A,B,...", help="Names of the columns of a bare table."),
    ] = None
    rate: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Samples per second, in place of a time."),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PeakOptions:
    """What is said over the settings of where a push is, and how high."""

    channel: Annotated[
        str | None, typer.Option(metavar="NAME", help="Channel that shows the pushes.")
    ] = None
    invert: Invert = False
    height: Annotated[
        Literal["auto", "apex", "plateau"] | None,
        typer.Option(help="What the height of a push is; auto: by its own shape."),
    ] = None
    min_height: Annotated[
        float | None,
        typer.Option(
            metavar="H", help="Smallest height of a push, in the unit of its column."
        ),
    ] = None
    split: Annotated[
        float | None,
        typer.Option(
            metavar="0..1", help="Valley below which two humps are two pushes."
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """How an analysis is made, and what is made of it."""

    out: OutFolder = None
    pictures: Pictures = None
    engine: Engine = "auto"
    checkpoint: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Keep the chain of emcee; the same command goes on where it stopped.",
        ),
    ] = None
    seed: Seed = 0
    json: JsonOption = False
    force: Force = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Items:
    """What is common to the items of a batch, and the folder of their results."""

    out: ResultFolder
    config: ConfigFile = None
    profile: Profile = None
    schedule: ScheduleFile = None
    engine: Engine = "auto"
    seed: Seed = 0
