"""`pushfit compare`: rolling and mechanics, by evidence and by prediction.

Excluded: the models compared (`pushfit.fit.comparison`).
"""

from pushfit.cli import options
from pushfit.cli.inputs import load_table, warn_of_unread
from pushfit.cli.session import CommandSession
from pushfit.errors import FitError


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
    if json:
        session.print_json(comparison_dict(found))
    else:
        print(comparison_text(found))
    return 0 if found.status is FitStatus.OK else FitError.exit_code
