"""`identify`, `fit`, `demo`, `compare`, `coverage`: from recordings or peaks to words.

Excluded: what is computed (`pushfit.fit.identify.identify_table`,
`pushfit.fit.comparison`, `pushfit.fit.coverage`).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pushfit.cli import options
from pushfit.cli.background import aside
from pushfit.cli.inputs import load_peaks, load_table, read_settings, warn_of_unread
from pushfit.cli.output import refuse_picture, warn_of_missing
from pushfit.cli.session import CommandSession
from pushfit.cli.stop import say_kept
from pushfit.errors import FitError
from pushfit.report.store.output_folder import PARTS, check_target

if TYPE_CHECKING:
    from pushfit.config import GraspConfig
    from pushfit.data.tables.peak_table import PeakTable


def identify(
    session: CommandSession,
    recordings: options.Recordings,
    schedules: options.Schedules = None,
    *,
    layout: options.SettingsOptions,
    invert: options.Invert = False,
    wanted: options.Analysis,
) -> int:
    """From recordings of pushes to theta_c and alpha*."""
    warn_of_unread(session, layout.config, *recordings)
    settings = read_settings(layout, invert=invert)
    load = partial(load_peaks, session, recordings, schedules or [], config=settings)
    return analyse(
        session,
        load,
        settings,
        wanted=wanted,
        recordings=tuple(str(path) for path in recordings),
        schedules=tuple(str(path) for path in schedules or ()),
    )


def fit(
    session: CommandSession,
    table: options.TableFile,
    config: options.ConfigFile = None,
    *,
    wanted: options.Analysis,
) -> int:
    """From a table of peaks to theta_c and alpha*."""
    from pushfit.config import read_config

    warn_of_unread(session, config, table)
    settings = read_config(config)
    load = partial(load_table, table, settings)
    return analyse(session, load, settings, wanted=wanted, table=str(table))


def demo(
    session: CommandSession,
    *,
    out: options.OutFolder = None,
    pictures: options.Pictures = None,
    seed: options.Seed = 0,
    json: options.JsonOption = False,
    force: options.Force = False,
) -> int:
    """Identify the simulated foam box."""
    folder = example_folder()
    sweeps = ("theta", "alpha")
    return identify(
        session,
        [folder / f"{sweep}_sweep.csv" for sweep in sweeps],
        [folder / f"{sweep}_schedule.csv" for sweep in sweeps],
        layout=options.SettingsOptions(config=folder / "grasp.toml"),
        wanted=options.Analysis(
            out=out, pictures=pictures, seed=seed, json=json, force=force
        ),
    )


def analyse(
    session: CommandSession,
    load: Callable[[], "PeakTable"],
    settings: "GraspConfig",
    *,
    wanted: options.Analysis,
    **inputs: Any,
) -> int:
    """Load, identify, write and print; the exit code says if numbers are trusted.

    Args:
        inputs: The files that it loads, as a `Recipe` names them.
    """
    # Before anything is loaded, so that a name already taken costs nothing.
    if wanted.out is not None:
        check_target(wanted.out, force=wanted.force, checkpoint=wanted.checkpoint)
        warn_of_missing(session, *PARTS)
    if "recordings" in inputs:
        # Which takes as long as JAX does.
        load = aside(load)
    from pushfit.fit.identify.progress import Stages, stages_of
    from pushfit.fit.programs.compile import loaded_ahead

    own = stages_of(settings, wanted.engine)
    with loaded_ahead("; ".join(own)) as is_compiled:
        from pushfit.fit.identify.identify_table import identify_table
        from pushfit.fit.results import FitStatus, Recipe
        from pushfit.report.text.first_look import FirstLook

        table = load()
        if wanted.checkpoint is not None:
            say_kept(
                f"the chain is kept in {wanted.checkpoint}; the same command goes on",
                once=wanted.checkpoint,
            )
        later = ["next push"] + ["report and figures"] * (wanted.out is not None)
        with session.progress() as progress:
            stages = Stages([*own, *later], progress, is_compiled=is_compiled)
            found = identify_table(
                table,
                settings,
                seed=wanted.seed,
                engine=wanted.engine,
                stages=stages,
                listener=FirstLook(tell=progress.tell),
                checkpoint=wanted.checkpoint,
            )
            stages.begin("next push")
            # What takes long to load comes when the first answers are on the screen.
            from pushfit.explore.advice import with_next_push

            recipe = Recipe(config=settings.model_dump(mode="json"), **inputs)
            found = replace(with_next_push(found), recipe=recipe)
            if wanted.out is not None:
                stages.begin("report and figures")
                from pushfit.report.store.folder import write_result_folder

                write_result_folder(
                    found, wanted.out, force=wanted.force, pictures=wanted.pictures
                )
    if wanted.out is not None:
        session.wrote(wanted.out)
    from pushfit.report.store.summary import summary_dict
    from pushfit.report.text.result import render_text

    session.answer(summary_dict(found) if wanted.json else render_text(found))
    return 0 if found.status is FitStatus.OK else FitError.exit_code


def compare(
    session: CommandSession,
    table: options.TableFile,
    config: options.ConfigFile = None,
    *,
    seed: options.Seed = 0,
    json: options.JsonOption = False,
) -> int:
    """Compare ways of rolling and mechanics on one table."""
    from pushfit.config import read_config
    from pushfit.fit.comparison import compare_models
    from pushfit.fit.results import FitStatus
    from pushfit.report.text.comparison import comparison_dict, comparison_text

    warn_of_unread(session, config, table)
    settings = read_config(config)
    peaks = load_table(table, settings)
    with session.progress() as progress:
        found = compare_models(peaks, settings, seed=seed, progress=progress)
    session.answer(comparison_dict(found) if json else comparison_text(found))
    return 0 if found.status is FitStatus.OK else FitError.exit_code


def coverage(
    session: CommandSession,
    table: options.TableFile,
    config: options.ConfigFile = None,
    *,
    tables: Annotated[
        int, typer.Option("--tables", min=1, help="Number of tables to simulate.")
    ] = 20,
    plot: options.PlotFile = None,
    seed: options.Seed = 0,
    json: options.JsonOption = False,
    force: options.Force = False,
) -> None:
    """Measure how often intervals hold the truth for these pushes."""
    refuse_picture(plot, force=force)
    from pushfit.config import read_config
    from pushfit.fit.coverage import coverage_study
    from pushfit.report.figures import save_figure
    from pushfit.report.figures.diagnostics import study_figure
    from pushfit.report.text.coverage import study_dict, study_text

    settings = read_config(config)
    peaks = load_table(table, settings)
    with session.progress() as progress:
        found = coverage_study(
            peaks, settings, n_tables=tables, seed=seed, progress=progress
        )
    if plot is not None:
        save_figure(study_figure(found), plot)
        session.wrote(plot)
    session.answer(study_dict(found) if json else study_text(found))


def example_folder() -> Path:
    """Folder of the example, in an installed package or in a checkout."""
    package = Path(__file__).parents[2]
    installed = package / "examples" / "foam_box"
    return installed if installed.is_dir() else package.parent / "examples" / "foam_box"
