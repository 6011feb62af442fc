"""`init`, `validate`, `peaks` and `simulate`: what comes before anything is fitted.

Excluded: the checks (`pushfit.data.check`), the measuring of pushes
(`pushfit.data.peaks.extract`) and the simulation (`pushfit.data.simulate`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pushfit.cli import options
from pushfit.cli.asked import UnitOption, sensor_unit
from pushfit.cli.inputs import load_peaks, read_settings
from pushfit.cli.output import refuse_existing, refuse_picture, write_text
from pushfit.cli.session import CommandSession
from pushfit.errors import ConfigError, DataError, counted, placed_in
from pushfit.report.strings import printable

if TYPE_CHECKING:
    from pushfit.config import GraspConfig
    from pushfit.data.peaks.extract import Heights
    from pushfit.data.tables.peak_table import PeakTable
    from pushfit.data.tables.traces import Trace

SCHEMA = "pushfit.validate/1"


def init(
    session: CommandSession,
    path: Annotated[
        Path, typer.Argument(metavar="FILE", help="File to write, - for stdout.")
    ] = Path("grasp.toml"),
    force: options.Force = False,
) -> None:
    """Write a commented grasp.toml with all defaults."""
    from pushfit.config import template

    target = None if str(path) == "-" else path
    if target is not None:
        refuse_existing(target, force=force)
    remark = "; set push.length_mm, then run `pushfit identify`"
    write_text(session, template(), target, remark=remark)


def validate(
    session: CommandSession,
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="Recordings, schedules, tables, settings."
        ),
    ],
    *,
    layout: options.SettingsOptions,
    json: options.JsonOption = False,
) -> int:
    """Say what files hold, or what is wrong with them."""
    from pushfit.data.check import check_files
    from pushfit.data.load import reader_options
    from pushfit.data.text.faults import in_few_lines

    settings = read_settings(layout)
    checked = {path: check_files([path], **reader_options(settings)) for path in files}
    problems = [problem for of_file in checked.values() for problem in of_file]
    found = [
        facts
        for path, faults in checked.items()
        if not faults
        for facts in describe(path, settings)
    ]
    for message in in_few_lines(problems):
        session.complain(message)
    if json:
        session.answer(
            {
                "schema": SCHEMA,
                "status": "rejected" if problems else "ok",
                "problems": [
                    asdict(problem) | {"message": session.worded(problem.message)}
                    for problem in problems
                ],
                "files": found,
            }
        )
    else:
        print(session.worded("\n\n".join(as_text(facts) for facts in found)))
    return DataError.exit_code if problems else 0


def peaks(
    session: CommandSession,
    recording: options.RecordingFile,
    schedule: options.ScheduleFile = None,
    *,
    layout: options.SettingsOptions,
    search: options.PeakOptions,
    exclude: options.Exclude = None,
    include: options.Include = None,
    begin: options.From = None,
    end: options.To = None,
    output: options.OutFile = None,
    plot: options.PlotFile = None,
    force: options.Force = False,
) -> None:
    """Heights of the pushes in a recording, as CSV and as a picture."""
    refuse_picture(plot, force=force)
    if output is not None:
        refuse_existing(output, force=force)
    from pushfit.data.check import expect_kind
    from pushfit.data.load import configured_recording, reader_options
    from pushfit.data.tables.peak_table import write_table

    settings = read_settings(
        layout, **asdict(search), exclude=exclude, include=include, begin=begin, end=end
    )

    if schedule is None:
        expect_kind(recording, "recording", **reader_options(settings))
        samples = configured_recording(recording, settings)
        if samples.theta is None or samples.alpha is None:
            from pushfit.data.peaks.extract import measure_pushes

            found = measure_pushes(samples, settings=settings.peaks)
            notes = (*samples.notes, *found.notes)
            print_heights(session, recording, found, notes=notes, output=output)
            if plot is not None:
                draw_peaks(session, found.trace, found, plot=plot)
            return
    schedules = [] if schedule is None else [schedule]
    try:
        table = load_peaks(session, [recording], schedules, config=settings)
    except DataError as error:
        if plot is not None and error.code == "push_mismatch":
            # Where pushes are missing, a picture is needed most.
            settings = settings.with_keys("peaks", allow_missing=True)
            table = load_peaks(session, [recording], schedules, config=settings)
            draw_peaks(session, table.traces[0], table, plot=plot)
        raise
    if plot is not None:
        draw_peaks(session, table.traces[0], table, plot=plot)
    if output is None:
        print(table.frame.to_csv(index=False), end="")
        return
    write_table(table, output)
    session.wrote(output, f": {counted(table.n_pushes, 'push')}")


def print_heights(
    session: CommandSession,
    path: Path,
    found: "Heights",
    *,
    notes: Sequence[str],
    output: Path | None,
) -> None:
    """Give the heights of pushes whose directions are not known."""
    for note in notes:
        tell = session.warn if note in found.cautions else session.say_more
        tell(f"{path}: {note}")
    n = len(found.frame)
    what = f"{n} pushes have heights and times but no directions"
    if n == 1:
        what = "one push has a height and times but no direction"
    session.say(
        f"{path}: no angles and no schedule, so the {what}; give --schedule for a fit"
    )
    text = found.frame.to_csv(index=False, lineterminator="\n")
    write_text(session, text, output, remark=f": {counted(n, 'push')}")


def draw_peaks(
    session: CommandSession, trace: "Trace", table: "PeakTable | Heights", *, plot: Path
) -> None:
    """Draw the signal of a recording with what was taken from it."""
    from pushfit.report.figures import save_figure, signal_figure

    save_figure(signal_figure(trace, table), plot)
    session.wrote(plot)


def simulate(
    session: CommandSession,
    schedule: Annotated[
        Path, typer.Argument(metavar="SCHEDULE", help="Directions of the pushes.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            *("--out", "-o", "--output"), metavar="FILE", help="Recording to write."
        ),
    ],
    *,
    config: options.ConfigFile = None,
    unit: UnitOption = None,
    noise: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Standard deviation of a sample; directions are off by up to 0.5 "
            "degrees all the same.",
        ),
    ] = 0.0,
    seed: options.Seed = 0,
    force: options.Force = False,
) -> None:
    """Record simulated pushes of a stated grasp."""
    from pushfit.config import read_config
    from pushfit.data.plans.schedule import read_schedule
    from pushfit.data.simulate import write_recording
    from pushfit.data.truth import simulate_from_config

    refuse_existing(output, force=force)
    plan, settings = read_schedule(schedule), read_config(config)
    with placed_in(str(config or ""), only=ConfigError):
        recording = simulate_from_config(
            plan,
            settings,
            unit=sensor_unit(settings, stated=unit),
            noise=noise,
            seed=seed,
        )
    write_recording(recording, output)
    session.wrote(output, ": simulated")


def describe(path: Path, config: "GraspConfig") -> Iterator[dict[str, object]]:
    """What was recognised in one file, of a table grasp by grasp."""
    from pushfit.data.check import directions, file_kind
    from pushfit.data.load import reader_options
    from pushfit.data.plans.schedule import read_schedule
    from pushfit.data.recordings.recording import read_recording
    from pushfit.data.tables.grasps import read_tables

    layout = reader_options(config)
    kind = file_kind(path, **layout)
    facts: dict[str, object] = {"path": str(path), "kind": kind}
    if kind == "recording":
        recording = read_recording(path, **layout)
        angles = (recording.theta, recording.alpha)
        yield facts | {
            "samples": len(recording.time),
            "time_s": [float(recording.time[0]), float(recording.time[-1])],
            "channels": [f"{name}_{unit}" for name, unit in recording.units.items()],
            "has_angles": all(angle is not None for angle in angles),
            "notes": list(recording.notes),
            "cautions": list(recording.cautions),
            "sources": [asdict(source) for source in recording.sources],
        }
    elif kind == "table":
        # Which takes as long as JAX does.
        from pushfit.fit.checks.table_checks import faults_of

        for grasp, table in read_tables(path).items():
            yield (
                facts
                | ({} if grasp is None else {"grasp": grasp})
                | {
                    "pushes": table.n_pushes,
                    "used": int(table.is_used.sum()),
                    **directions(table.theta, table.alpha),
                    "channels": [f"{name}_{table.unit}" for name in table.channels],
                    "notes": list(table.notes),
                    "warnings": [asdict(warning) for warning in faults_of(table)],
                    "sources": [asdict(source) for source in table.sources],
                }
            )
    elif kind == "settings":
        yield facts
    else:
        plan = read_schedule(path)
        yield facts | {"pushes": plan.n_pushes, **directions(plan.theta, plan.alpha)}


def as_text(facts: Mapping[str, object]) -> str:
    """Facts one below the other, as `print` is to show them."""
    lines = []
    for name, value in facts.items():
        if name in {"notes", "cautions"} and isinstance(value, list):
            kind = "note" if name == "notes" else "warning"
            lines += [printable(f"{kind:<10} {note}") for note in value]
        elif name == "warnings" and isinstance(value, list):
            lines += [printable(f"{'warning':<10} {one['text']}") for one in value]
        elif name != "sources":
            shown = ", ".join(map(str, value)) if isinstance(value, list) else value
            lines.append(printable(f"{name:<10} {shown}"))
    return "\n".join(lines)
