"""`identify`, `fit` and `demo`: from recordings or peaks to a report."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from pushfit.cli import options
from pushfit.cli.inputs import load_peaks, load_table, read_settings
from pushfit.cli.session import Session
from pushfit.cli.stop import keep
from pushfit.errors import FitError
from pushfit.report.store.target import check_target

if TYPE_CHECKING:
    from pushfit.config import GraspConfig
    from pushfit.data.tables.peak_table import PeakTable


def identify(
    session: Session,
    recordings: options.Recordings,
    schedules: options.Schedules = None,
    config: options.ConfigFile = None,
    profile: options.Profile = None,
    format: options.Format = None,
    map: options.Map = None,
    unit: options.UnitOf = None,
    columns: options.Columns = None,
    invert: options.Invert = False,
    out: options.OutFolder = None,
    pictures: options.Pictures = None,
    engine: options.Engine = "auto",
    checkpoint: options.Checkpoint = None,
    seed: options.Seed = 0,
    json: options.Json = False,
    force: options.Force = False,
) -> int:
    """From recordings of pushes to theta_c and alpha*."""

    def load(settings: "GraspConfig") -> "PeakTable":
        return load_peaks(session, recordings, schedules or [], settings)

    settings = read_settings(
        config,
        profile=profile,
        format=format,
        map=map,
        unit=unit,
        columns=columns,
        peaks={"invert": invert},
    )
    request = Request(
        recordings=tuple(str(path) for path in recordings),
        schedules=tuple(str(path) for path in schedules or ()),
        out=out,
        pictures=pictures,
        engine=engine,
        checkpoint=checkpoint,
        seed=seed,
        json=json,
        force=force,
    )
    return analyse(session, load, settings, request)


def fit(
    session: Session,
    table: options.TableFile,
    config: options.ConfigFile = None,
    out: options.OutFolder = None,
    pictures: options.Pictures = None,
    engine: options.Engine = "auto",
    checkpoint: options.Checkpoint = None,
    seed: options.Seed = 0,
    json: options.Json = False,
    force: options.Force = False,
) -> int:
    """From a table of peaks to theta_c and alpha*."""
    from pushfit.config import read_config

    def load(settings: "GraspConfig") -> "PeakTable":
        return load_table(table, settings)

    request = Request(
        table=str(table),
        out=out,
        pictures=pictures,
        engine=engine,
        checkpoint=checkpoint,
        seed=seed,
        json=json,
        force=force,
    )
    return analyse(session, load, read_config(config), request)


def demo(
    session: Session,
    out: options.OutFolder = None,
    pictures: options.Pictures = None,
    seed: options.Seed = 0,
    json: options.Json = False,
    force: options.Force = False,
) -> int:
    """Identify the simulated foam box."""
    folder = example_folder()
    sweeps = ("theta", "alpha")
    return identify(
        session,
        [folder / f"{sweep}_sweep.csv" for sweep in sweeps],
        [folder / f"{sweep}_schedule.csv" for sweep in sweeps],
        folder / "grasp.toml",
        out=out,
        pictures=pictures,
        seed=seed,
        json=json,
        force=force,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What the user wants of an analysis.

    Args:
        out: Folder of the result.
        pictures: Format that all figures are to have as well.
        engine: How the posterior is found.
        checkpoint: File of an unfinished chain.
        seed: Seed of all randomness.
        json: Whether to print the summary instead of the report.
        force: Whether the folder may be replaced.
        recordings: Recordings, as named.
        schedules: Their schedules.
        table: Table of peaks, where there are no recordings.
    """

    out: Path | None
    pictures: str | None
    engine: str
    checkpoint: Path | None
    seed: int
    json: bool
    force: bool
    recordings: tuple[str, ...] = ()
    schedules: tuple[str, ...] = ()
    table: str | None = None


def analyse(
    session: Session,
    load: Callable[["GraspConfig"], "PeakTable"],
    settings: "GraspConfig",
    request: Request,
) -> int:
    """Load, identify, write and print.

    Args:
        load: What makes the table under a configuration.

    Returns:
        Exit code: that of a `FitError` if the numerics are not to be trusted.
    """
    # Before anything is loaded, so that a name already taken costs nothing.
    if request.out is not None:
        check_target(request.out, force=request.force)
    from pushfit.fit.programs import ANALYSIS, has_run, note_run

    is_compiled = has_run(ANALYSIS)
    table = load(settings)
    if request.checkpoint is not None:
        keep(f"the chain is kept in {request.checkpoint}; the same command goes on")
    from pushfit.fit.identify import identify_table
    from pushfit.fit.results import FitStatus, Recipe
    from pushfit.fit.stages import Stages, stages_of
    from pushfit.report.text.first import First

    own = stages_of(settings, request.engine)
    later = ["next push"] + ["report and figures"] * (request.out is not None)
    with session.progress() as progress:
        stages = Stages([*own, *later], progress, is_compiled=is_compiled)
        found = identify_table(
            table,
            settings,
            seed=request.seed,
            engine=request.engine,
            stages=stages,
            listener=First(tell=progress.tell),
            checkpoint=request.checkpoint,
        )
        stages.begin("next push")
        # What takes long to load comes when the first answers are on the screen.
        from pushfit.explore.advice import with_next_push

        recipe = Recipe(
            config=settings.model_dump(mode="json"),
            recordings=request.recordings,
            schedules=request.schedules,
            table=request.table,
        )
        found = replace(with_next_push(found), recipe=recipe)
        if request.out is not None:
            stages.begin("report and figures")
            from pushfit.report.store.folder import write_result_folder

            write_result_folder(
                found, request.out, force=request.force, pictures=request.pictures
            )
    note_run(ANALYSIS)
    if request.out is not None:
        session.wrote(request.out)
    if request.json:
        from pushfit.report.store.summary import summary_dict

        session.print_json(summary_dict(found))
    else:
        from pushfit.report.text.result import render_text

        print(render_text(found))
    return 0 if found.status is FitStatus.OK else FitError.exit_code


def example_folder() -> Path:
    """Folder of the example, in an installed package or in a checkout."""
    package = Path(__file__).parents[2]
    installed = package / "examples" / "foam_box"
    return installed if installed.is_dir() else package.parent / "examples" / "foam_box"
