"""`validate`, `peaks` and `simulate`: what happens before anything is fitted."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pushfit.cli import options
from pushfit.cli.inputs import load_peaks, load_recording
from pushfit.cli.output import refuse_existing
from pushfit.cli.session import Session

if TYPE_CHECKING:
    from pushfit.config import GraspConfig

SCHEMA = "pushfit.validate/1"
Kind = Literal["recording", "schedule", "peaks"]
Unit = Literal["n", "kpa", "counts", "au"]


def validate(
    session: Session,
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Files.")],
    kind: Annotated[
        Kind, typer.Option("--as", help="What the files are meant to be.")
    ] = "recording",
    config: options.ConfigFile = None,
    json: options.Json = False,
) -> None:
    """Say what files hold, or what is wrong with them."""
    from pushfit.config import read_config

    settings = read_config(config)
    found = [describe(session, path, kind, settings) for path in files]
    if json:
        session.print_json({"schema": SCHEMA, "status": "ok", "files": found})
        return
    for facts in found:
        for name, value in facts.items():
            shown = value if isinstance(value, list) else [value]
            for item in shown:
                print(f"{name:<10} {item}")


def peaks(
    session: Session,
    recording: options.RecordingFile,
    schedule: options.ScheduleFile = None,
    config: options.ConfigFile = None,
    output: options.OutFile = None,
    force: options.Force = False,
) -> None:
    """Heights of the pushes in a recording, as CSV."""
    from pushfit.config import read_config
    from pushfit.data.table import write_table

    if output is not None:
        refuse_existing(output, force=force)
    schedules = [] if schedule is None else [schedule]
    table = load_peaks(session, [recording], schedules, read_config(config))
    if output is None:
        print(table.frame.to_csv(index=False), end="")
        return
    write_table(table, output)
    session.say(f"wrote {output}: {table.n_pushes} pushes")


def simulate(
    session: Session,
    schedule: Annotated[
        Path, typer.Argument(metavar="SCHEDULE", help="Directions of the pushes.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Recording to write.")
    ],
    config: options.ConfigFile = None,
    unit: Annotated[Unit, typer.Option(help="Unit of the sensor.")] = "n",
    noise: Annotated[
        float, typer.Option(min=0.0, help="Standard deviation of a sample.")
    ] = 0.0,
    seed: options.Seed = 0,
    force: options.Force = False,
) -> None:
    """Record simulated pushes of a stated grasp."""
    from pushfit.config import read_config
    from pushfit.data.schedule import read_schedule
    from pushfit.data.simulate import write_recording
    from pushfit.data.truth import simulate_from_config

    refuse_existing(output, force=force)
    recording = simulate_from_config(
        read_schedule(schedule), read_config(config), unit=unit, noise=noise, seed=seed
    )
    write_recording(recording, output)
    session.say(f"wrote {output}: simulated")


def describe(
    session: Session, path: Path, kind: Kind, config: "GraspConfig"
) -> dict[str, object]:
    """What was recognised in one file.

    Args:
        session: Where notes go.
        path: File.
        kind: What it is meant to be.
        config: Settings in force.

    Returns:
        Facts by name, as JSON knows them.
    """
    from pushfit.data.schedule import read_schedule
    from pushfit.data.table import read_table

    if kind == "recording":
        recording = load_recording(session, path, config)
        sources, notes = recording.sources, recording.notes
        facts = {
            "samples": len(recording.time),
            "from_s": float(recording.time[0]),
            "to_s": float(recording.time[-1]),
            "channels": [f"{name}_{unit}" for name, unit in recording.units.items()],
            "angles": [
                n for n in ("theta", "alpha") if getattr(recording, n) is not None
            ],
        }
    elif kind == "peaks":
        table = read_table(path)
        sources, notes = table.sources, table.notes
        facts = {
            "pushes": table.n_pushes,
            "used": int(table.is_used.sum()),
            "channels": [f"{name}_{table.unit}" for name in table.channels],
        }
    else:
        schedule = read_schedule(path)
        sources, notes = [schedule.source], []
        facts = {"pushes": schedule.n_pushes}
    source = next(s for s in sources if s is not None)
    return {
        "path": str(path),
        "dialect": source.dialect,
        "sha256": source.sha256,
        **facts,
        "notes": list(notes),
    }
