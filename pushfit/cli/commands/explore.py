"""`next` and `explore`: which push to make, and a hand that makes them.

Excluded: how pushes are chosen (`pushfit.explore.explorer`).
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pushfit.cli import options
from pushfit.cli.asked import Asked, UnitOption, sensor_unit
from pushfit.cli.inputs import warn_of_unread
from pushfit.cli.output import refuse_picture, warn_of_missing
from pushfit.cli.session import CommandSession
from pushfit.cli.stop import say_kept
from pushfit.errors import ConfigError, DataError, FitError, placed_in
from pushfit.report.store.output_folder import PARTS

if TYPE_CHECKING:
    from pushfit.explore.explorer import Explorer
    from pushfit.explore.hands.protocol import Hand
    from pushfit.explore.loop import Step


def next(
    session: CommandSession,
    table: Annotated[
        Path | None,
        typer.Argument(metavar="[TABLE]", help="Pushes made so far; none to begin."),
    ] = None,
    *,
    asked: Asked,
    unit: UnitOption = None,
    n: Annotated[int, typer.Option("-n", min=1, help="Pushes to rank.")] = 5,
    plot: options.PlotFile = None,
    seed: options.Seed = 0,
    json: options.JsonOption = False,
    force: options.Force = False,
) -> int:
    """Which push would tell most, after those made so far."""
    refuse_picture(plot, force=force)
    from pushfit.config import read_config
    from pushfit.fit.identify.progress import Stages, posterior_stage, stages_of
    from pushfit.fit.programs.compile import loaded_ahead

    if table is not None:
        warn_of_unread(session, asked.config, table)
    settings = asked.reaching(read_config(asked.config))
    own = [] if table is None else map(posterior_stage, settings.by_mechanics())
    names = [*own, "next push", *["picture"] * (plot is not None)]
    analysis = "; ".join(("next push", *stages_of(settings, "sweep")))
    with session.progress() as progress:
        with loaded_ahead(analysis) as is_compiled:
            from pushfit.data.tables.peak_table import read_table
            from pushfit.fit.checks.table_checks import ignored_columns
            from pushfit.report.text.exploration import next_dict, next_text

            made = None if table is None else read_table(table)
            ignored = () if made is None else tuple(ignored_columns(made))
            stages = Stages(names, progress, is_compiled=is_compiled)
            explorer = asked.explorer(
                settings,
                channels=None if made is None else made.channels,
                unit=sensor_unit(settings, stated=unit) if made is None else made.unit,
                seed=seed,
                stages=stages,
            )
            if made is not None:
                explorer.attach(made)
            stages.begin("next push")
            is_rejected = explorer.history.stopped is not None
            suggestions = explorer.ask(n)
        if plot is not None:
            stages.begin("picture")
            from pushfit.report.figures import save_figure
            from pushfit.report.figures.exploration import exploration_picture

            save_figure(exploration_picture(explorer, suggestions), plot)
    if plot is not None:
        session.wrote(plot)
    session.warn_of((*ignored, *explorer.belief.warnings))
    write = next_dict if json else next_text
    session.answer(write(explorer, suggestions))
    if explorer.history.stopped is None:
        return 0
    # By its heights, or by limits that allow no push.
    return DataError.exit_code if is_rejected else ConfigError.exit_code


def explore(
    session: CommandSession,
    hand: Annotated[
        Literal["simulated", "ros"], typer.Option(help="What makes the pushes.")
    ],
    out: options.ResultFolder,
    *,
    asked: Asked,
    truth: Annotated[
        Path | None,
        typer.Option(
            metavar="truth.toml",
            help="Grasp that the simulated hand holds, each fixed; left out, that of "
            "the example.",
        ),
    ] = None,
    noise: Annotated[
        float, typer.Option(min=0, help="Noise of a sample of the simulated sensor.")
    ] = 0.05,
    scatter: Annotated[
        float, typer.Option(min=0, help="Scatter of simulated pushes, as a share.")
    ] = 0.01,
    unit: UnitOption = None,
    seed: options.Seed = 0,
    json: options.JsonOption = False,
    force: options.Force = False,
) -> int:
    """Let a hand explore a grasp until the angle is known.

    Interrupted, killed or stopped by failures, the same command goes on.
    """
    from pushfit.cli.commands.analysis import example_folder
    from pushfit.config import read_config
    from pushfit.report.store.folder import check_target

    check_target(out, force=force)
    warn_of_missing(session, *PARTS)
    known_of = asked.config
    if hand == "simulated" and truth is None and known_of is None:
        known_of = example_folder() / "grasp.toml"
        session.say(f"the grasp of the example is explored, known by {known_of}")
    settings = asked.reaching(read_config(known_of))
    sensor, simulated = sensor_unit(settings, stated=unit), None
    made_by: dict[str, object] = {"kind": hand}
    if hand == "ros":
        from pushfit.explore.hands.ros.hand import RosHand

        finger: Hand = RosHand(
            has_forces=asked.has_forces(settings), theta_deg=settings.reach.theta_deg
        )
    else:
        from pushfit.explore.hands import simulated as simulation

        settings = simulation.joints_stated(settings)
        held_by = str(truth or "the grasp of the example, as no --truth is given")
        held = read_config(truth or example_folder() / "truth.toml")
        if "reach" not in held.model_fields_set:
            held = held.with_keys("reach", alpha_deg=settings.reach.alpha_deg)
        with placed_in(held_by, only=ConfigError):
            sensor = sensor_unit(settings, held, stated=unit)
        made_by |= {"noise": noise, "scatter": scatter}
        made_by["truth"] = held.model_dump(mode="json", exclude_none=True)
        normal = settings.peaks.normal or "fz"
        simulation.check_normal(normal)
        with placed_in(held_by, only=ConfigError):
            finger = simulated = simulation.simulated_hand(
                held,
                theta_deg=settings.reach.theta_deg,
                unit=sensor,
                noise=noise,
                scatter=scatter,
                forces=asked.has_forces(settings),
                seed=seed,
                normal=normal,
            )
    journal = out.with_name(f"{out.name}.journal.jsonl")
    explorer = asked.explorer(
        settings, unit=sensor, journal=journal, seed=seed, hand=made_by
    )
    say_kept(
        f"what was pushed is kept in {journal}; the same command goes on", once=journal
    )
    known = explorer.history
    if known.told or known.failures:
        session.say(f"going on with {journal}: {len(known.told)} pushes are known")
    session.warn_of(explorer.belief.warnings)
    if simulated is not None:
        simulated.pass_by(known.n_made, rest=explorer.limits.rest_s)
    return _run(
        session, explorer, finger, journal=journal, out=out, json=json, force=force
    )


def _run(
    session: CommandSession,
    explorer: "Explorer",
    finger: "Hand",
    *,
    journal: Path,
    out: Path,
    json: bool,
    force: bool,
) -> int:
    """Explore, identify the table of the journal, and write the folder."""
    from pushfit.config import template
    from pushfit.explore.advice import with_next_push
    from pushfit.explore.loop import explore as run
    from pushfit.fit.identify.identify_table import identify_table
    from pushfit.fit.results import FitStatus
    from pushfit.report.answers import ANSWERS
    from pushfit.report.figures import figure_bytes
    from pushfit.report.figures.exploration import exploration_picture
    from pushfit.report.store.folder import write_result_folder
    from pushfit.report.store.output_folder import EXPLORATION, JOURNAL, SETTINGS
    from pushfit.report.store.summary import summary_dict
    from pushfit.report.text.exploration import ADAPTIVE, state_dict

    settings = explorer.question.settings
    with watched(session) as watch:
        state = run(explorer, finger, settings=settings.peaks, watch=watch)
    table = explorer.table
    if table is None:
        again = (
            "put it right, and the same command goes on; for other limits remove "
            f"{journal}, or give another --out"
        )
        if explorer.history.is_over:
            again = f"remove {journal}, or give another --out"
        raise ConfigError(
            f"{state.sentence}; without a push of full length there is no result to "
            f"write; {again}",
            code="no_push",
        )
    if json:
        session.say(state.sentence, style="bold")
    found = identify_table(table, settings, seed=explorer.judge.seed)
    found = replace(with_next_push(found), warnings=(*found.warnings, ADAPTIVE))
    picture = figure_bytes(exploration_picture(explorer), "png")
    write_result_folder(
        found,
        out,
        force=force,
        extra={
            JOURNAL: journal.read_bytes(),
            EXPLORATION: picture,
            SETTINGS: template(settings).encode(),
        },
    )
    session.wrote(out)
    session.warn_of(found.warnings)
    _say_what_next(session, explorer, journal=journal, out=out)
    if json:
        session.answer({**summary_dict(found), "exploration": state_dict(state)})
    else:
        print(state.sentence)
        for name in explorer.question.ask:
            print(f"Identified from all pushes: {ANSWERS[name](found).sentence}")
    return 0 if found.status is FitStatus.OK else FitError.exit_code


def _say_what_next(
    session: CommandSession, explorer: "Explorer", *, journal: Path, out: Path
) -> None:
    """How an exploration goes on; the journal of one that is over is removed."""
    from pushfit.explore.records import Answer
    from pushfit.report.store.output_folder import JOURNAL, SETTINGS

    history = explorer.history
    if history.stopped is not None and not history.is_over:
        session.say(
            f"put it right, and the same command with --force goes on with {journal}; "
            "other limits need another --out"
        )
        return
    journal.unlink()
    if explorer.state.answer is Answer.OUT_OF_BUDGET:
        session.say(
            f"to go on with this grasp, copy {out / JOURNAL} to {journal}, and "
            "give the same command a larger --budget, and --force; or ask "
            f"`pushfit next {out / 'peaks.csv'} --config {out / SETTINGS}`, "
            "with the same --ask, --width, --sigma and --max-force"
        )


@contextmanager
def watched(session: CommandSession) -> Iterator[Callable[["Step"], None]]:
    """Follow the pushes: a live table on a terminal, else a line for each."""
    import sys

    from pushfit.report.text.exploration import progress_line

    def line(step: "Step") -> str:
        push, fault = step.suggestion, step.fault
        what = f"{push.purpose.value} push {push.number}: {push.describe()}"
        return what if fault is None else f"{what} failed: {fault}"

    if session.is_quiet or not sys.stderr.isatty():
        yield lambda step: session.say(f"{line(step)}; {progress_line(step.state)}")
        return
    from rich.console import Console
    from rich.live import Live
    from rich.table import Table

    recent: list[str] = []

    def shown(step: "Step") -> Table:
        recent.append(line(step))
        grid = Table.grid(padding=(0, 2))
        grid.add_row("state", step.state.answer.value)
        grid.add_row("known", progress_line(step.state))
        grid.add_row("pushes", f"{step.state.n_pushes}, {step.state.n_left} left")
        for text in recent[-5:]:
            grid.add_row("", text)
        return grid

    with Live(console=Console(stderr=True), refresh_per_second=8) as live:
        yield lambda step: live.update(shown(step))
