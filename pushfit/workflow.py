"""From whatever holds the pushes to a result in one call, as `pushfit identify` does.

Files, frames and records are taken alike. Excluded: what a result shows, which is in
`pushfit.report.result`.
"""

import contextlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import pandas as pd

from pushfit.arguments import checked
from pushfit.config import GraspConfig, Settings, as_config
from pushfit.data.check import expect_kind, file_kind
from pushfit.data.load import configured_recording, reader_options
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import PushSchedule, read_schedule
from pushfit.data.recordings.records import Recording
from pushfit.data.tables.merge import merge_tables
from pushfit.data.tables.peak_table import PeakTable, read_table
from pushfit.errors import (
    ConfigError,
    ConvergenceError,
    PushfitError,
    check_seed,
    counted,
)
from pushfit.explore.advice import with_next_push
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.identify.progress import Progress, Stages, stages_of
from pushfit.fit.programs.compile import loaded_ahead
from pushfit.fit.programs.folder import keep_programs
from pushfit.fit.results import FitStatus, Identification, Recipe
from pushfit.report.result import Result
from pushfit.report.strings import time_left
from pushfit.report.text.first_look import FirstLook

Read = TypeVar("Read")
AnyPath = str | Path
AnyTable = AnyPath | pd.DataFrame | Recording | PeakTable
AnyPlan = AnyPath | pd.DataFrame | PushSchedule
# What a frame is called in messages of its reader.
FRAME = "DataFrame"


@checked
def identify(
    recordings_or_table: AnyTable | Sequence[AnyTable],
    schedule: AnyPlan | Sequence[AnyPlan] | None = None,
    config: Settings | None = None,
    *,
    seed: int = 0,
    engine: str = "auto",
    progress: Progress | None = None,
    checkpoint: AnyPath | None = None,
    throw: bool = False,
) -> Result:
    """From recordings of pushes, or a table of their heights, to θ_c and α*.

    Args:
        recordings_or_table: One or several recordings of one grasp, or one table of
            peak heights: paths, frames whose columns state their units, or what
            `read_recording` and `read_table` give.
        schedule: Directions of the pushes, one schedule for each recording; None where
            the recordings have angle columns, and for a table.
        config: What is known of grasp and sensor: a `grasp.toml`, its content, or what
            `read_config` gives.
        seed: Seed of all randomness: with the same one, the same numbers.
        engine: "sweep", "emcee", or "auto" for the sweep with emcee where its draws are
            not to be trusted.
        progress: Called with a stage and the share of it that is done; None shows both
            in a notebook.
        checkpoint: File in which a chain is kept, to be gone on with.
        throw: Raise instead of returning a result whose status is not OK.

    Returns:
        The result. Its status says whether numbers may be quoted.

    Raises:
        ConfigError: A file is missing, or settings or schedules do not fit.
        DataError: The input breaks a rule, or no push is left.
        FitError: No start gives finite residuals or a finite density, or the solver
            stopped at its step limit.
        ConvergenceError: The posterior density is infinite at some point, or `throw` is
            set and the status is not OK; then it carries the optima of the likelihood.
    """
    keep_programs()
    check_seed(seed)
    settings = as_config(config)
    own = stages_of(settings, engine)
    sources, plans = _several(recordings_or_table), _several(schedule)
    with (
        loaded_ahead("; ".join(own)) as is_compiled,
        shown_progress(progress) as (report, tell),
    ):
        table = gather(sources, plans, settings)
        stages = Stages([*own, "next push"], report, is_compiled=is_compiled)
        found = identify_table(
            table,
            settings,
            seed=seed,
            engine=engine,
            stages=stages,
            listener=FirstLook(tell=tell),
            checkpoint=None if checkpoint is None else Path(checkpoint),
        )
        if throw:
            _check_status(found)
        stages.begin("next push")
        found = with_next_push(found)
    return Result.of(replace(found, recipe=recipe_of(sources, plans, settings)))


def _check_status(found: Identification) -> None:
    """Refuse what may not be quoted."""
    if found.status is FitStatus.OK:
        return
    modes = found.fit.modes
    raise ConvergenceError(
        found.status.value,
        code=found.status.name.lower(),
        names=found.fit.names,
        points=[list(mode.coordinates.values()) for mode in modes],
        costs=[mode.chi_square for mode in modes],
    )


@contextlib.contextmanager
def shown_progress(
    progress: Progress | None,
) -> Iterator[tuple[Progress | None, Callable[[str], None]]]:
    """The user's way to show progress, else lines in a notebook, else none.

    Yields:
        Function of a stage and the share of it that is done, and one of a line that
        says what is known already.
    """
    notebook = sys.modules.get("IPython")
    shell = notebook.get_ipython() if notebook else None
    if progress is not None or notebook is None or not hasattr(shell, "kernel"):
        yield progress, lambda line: None
        return
    handle = notebook.display.display({"text/plain": ""}, raw=True, display_id=True)
    known: list[str] = []
    start = time.perf_counter()

    def write(*more: str) -> None:
        handle.update({"text/plain": "\n".join([*known, *more])}, raw=True)

    def tell(line: str) -> None:
        known.append(line)
        write()

    def report(stage: str, share: float) -> None:
        left = time_left(share, time.perf_counter() - start)
        write(f"{stage}: {100 * share:.0f} % done{left}")

    try:
        yield report, tell
    finally:
        write()


def gather(
    sources: Sequence[object], plans: Sequence[object], config: GraspConfig
) -> PeakTable:
    """Peak heights of one grasp.

    Args:
        sources: Recordings, or one table: each an `AnyTable`.
        plans: A schedule for each recording, or none: each an `AnyPlan`.

    Raises:
        ConfigError: Schedules and recordings do not go together, or are none.
        DataError: An input breaks a rule.
    """
    for plan in plans:
        if isinstance(plan, AnyPath) and Path(plan).suffix.lower() == ".toml":
            raise ConfigError(
                f"{plan}: is a file of settings, no schedule; give it as `config`",
                code="wrong_kind",
            )
    loaded = [_load(source, config) for source in sources]
    if not loaded:
        raise ConfigError(
            "nothing to identify; give recordings, or a table of peak heights",
            code="no_input",
        )
    tables = [one for one in loaded if isinstance(one, PeakTable)]
    if tables:
        _check_tables(tables, loaded, plans)
        return tables[0]
    if plans and len(plans) != len(loaded):
        raise ConfigError(
            f"{counted(len(loaded), 'recording')} and "
            f"{counted(len(plans), 'schedule')}; give one schedule for each recording, "
            "in the same order",
            code="schedule_count",
        )
    schedules = [_load_plan(plan) for plan in plans] or [None] * len(loaded)
    return merge_tables(
        [
            extract_peaks(recording, plan, settings=config.peaks)
            for recording, plan in zip(loaded, schedules, strict=True)
            if isinstance(recording, Recording)
        ]
    )


def _check_tables(
    tables: Sequence[PeakTable],
    loaded: Sequence[Recording | PeakTable],
    plans: Sequence[object],
) -> None:
    """Refuse a table together with what it makes no sense with."""
    if len(loaded) > 1:
        recordings = counted(len(loaded) - len(tables), "recording")
        kinds = f"{counted(len(tables), 'table')} and {recordings}"
        raise ConfigError(
            f"{kinds} at once; give recordings only, or one table "
            "(`merge_tables` makes one of several)",
            code="mixed_inputs",
        )
    if plans:
        raise ConfigError(
            "a table of peak heights has its directions and takes no schedule; leave "
            "the schedule out, or give the recording",
            code="table_with_schedule",
        )


def _load(source: object, config: GraspConfig) -> Recording | PeakTable:
    """A recording or a table, whatever it is given as."""
    if isinstance(source, Recording | PeakTable):
        return source
    if not isinstance(source, AnyPath | pd.DataFrame):
        raise ConfigError(
            f"{type(source).__name__}: holds no pushes that can be read; give a path, "
            "a DataFrame whose columns state their units, or what read_recording or "
            "read_table gives",
            code="input_type",
        )
    if isinstance(source, pd.DataFrame):
        if any(str(name).startswith("height") for name in source.columns):
            return PeakTable.from_frame(source)
        return _from_frame(source, lambda path: configured_recording(path, config))
    options = reader_options(config)
    if file_kind(source, **options) == "table":
        return read_table(source)
    expect_kind(source, "recording", **options)
    return configured_recording(source, config)


def _load_plan(plan: object) -> PushSchedule:
    if isinstance(plan, PushSchedule):
        return plan
    if isinstance(plan, pd.DataFrame):
        return _from_frame(plan, read_schedule)
    if not isinstance(plan, AnyPath):
        raise ConfigError(
            f"{type(plan).__name__}: is no schedule; give a path, a DataFrame or what "
            "read_schedule gives",
            code="input_type",
        )
    return read_schedule(plan)


def _from_frame(frame: pd.DataFrame, read: Callable[[Path], Read]) -> Read:
    """Read a frame as the file that it would be: by the same rules and messages."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frame.csv"
        frame.to_csv(path, index=False)
        try:
            return read(path)
        except PushfitError as error:
            raise type(error)(
                str(error).replace(str(path), FRAME),
                code=error.code,
                problems=tuple(
                    replace(
                        one, path=FRAME, message=one.message.replace(str(path), FRAME)
                    )
                    for one in error.problems
                ),
            ) from None


def recipe_of(
    sources: Sequence[object], plans: Sequence[object], config: GraspConfig
) -> Recipe | None:
    """Which files to read to do it again; None unless everything was a file."""
    if not all(isinstance(given, str | Path) for given in (*sources, *plans)):
        return None
    given = config.model_dump(mode="json")
    names = tuple(str(source) for source in sources)
    if len(names) == 1 and file_kind(names[0], **reader_options(config)) == "table":
        return Recipe(config=given, table=names[0])
    plan_names = tuple(str(plan) for plan in plans)
    return Recipe(config=given, recordings=names, schedules=plan_names)


def _several(given: object) -> list[object]:
    """What was given, in a list; None is nothing."""
    if given is None:
        return []
    return list(given) if isinstance(given, list | tuple) else [given]
