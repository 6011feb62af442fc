"""`pushfit coverage`: how often intervals would hold the truth for these pushes.

Excluded: the study itself (`pushfit.fit.coverage`).
"""

from typing import Annotated

import typer

from pushfit.cli import options
from pushfit.cli.inputs import load_table
from pushfit.cli.output import refuse_picture
from pushfit.cli.session import CommandSession


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
    if json:
        session.print_json(study_dict(found))
    else:
        print(study_text(found))
