"""`pushfit verify`: compute a result again from its inputs and compare every number.

Excluded: the comparison of numbers (`pushfit.report.store.reproduction`).
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pushfit.cli import options
from pushfit.cli.inputs import load_peaks
from pushfit.cli.session import CommandSession
from pushfit.errors import ConfigError, DataError, FitError

if TYPE_CHECKING:
    from pushfit.config import GraspConfig
    from pushfit.fit.results import Identification
    from pushfit.report.store.reproduction import Reproduction

SCHEMA = "pushfit.verify/1"
# Numbers that moved and are named, the worst first; --json has all.
N_SHOWN = 5


def verify(
    session: CommandSession,
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="Folder that --out wrote.")
    ],
    *,
    inputs: Annotated[
        Path | None,
        typer.Option(
            "--inputs", metavar="DIR", help="Where the inputs are, if they were moved."
        ),
    ] = None,
    json: options.JsonOption = False,
) -> int:
    """Compute a result again and compare every number."""
    from pushfit.report.store.read import read_summary
    from pushfit.report.store.reproduction import compare_result

    summary = read_summary(result)
    found = locate_inputs(summary, result, inputs)
    again = run_again(session, summary, found)
    comparison = compare_result(result, summary, again)
    words = "\n".join(sentences(comparison))
    session.answer(as_document(comparison, found) if json else words)
    return 0 if comparison.is_reproduced else FitError.exit_code


def locate_inputs(
    summary: dict[str, Any], result: Path, folder: Path | None
) -> dict[str, Path]:
    """Where inputs are now, by recorded name, each with the content it had then."""
    from pushfit.data.text.files import sha256_of
    from pushfit.report.store.output_folder import SETTINGS

    recipe = summary.get("recipe")
    if recipe is None:
        settings, note = result / SETTINGS, ""
        if not settings.is_file():
            settings, note = Path("GRASP.TOML"), " with the settings that it had"
        raise ConfigError(
            f"{result}: does not say which files became its table, which was made in "
            "Python or by `explore`; only results of `identify` and `fit` can be "
            f"verified. `pushfit fit {result / 'peaks.csv'} --config {settings} --seed "
            f"{summary['seed']} --out ANEW` identifies the table anew{note}; the "
            "numbers of both summary.json are then to be equal",
            code="no_recipe",
        )
    found = {}
    for source in summary["inputs"]:
        path = source["path"]
        # A table may carry the names of the recordings behind it; they are not read.
        if recipe["table"] not in (None, path):
            continue
        found[path] = locate(path, result, folder)
        digest = sha256_of(found[path])
        if digest != source["sha256"]:
            raise DataError(
                f"{found[path]}: is not what the result was made from: sha256 "
                f"{source['sha256']} is expected and {digest} found; restore the file, "
                "or name the folder of the original by --inputs",
                code="input_changed",
            )
    for path in recipe["recordings"]:
        # A bag that is a folder: its files are the sources.
        found.setdefault(path, locate(path, result, folder))
    return found


def locate(path: str, result: Path, folder: Path | None) -> Path:
    """Where an input is: as named, beside the result, or in a folder of the user's.

    Args:
        folder: Folder to look in instead; there the name alone is enough.
    """
    # Not in the result itself: its own peaks.csv is no witness.
    places = [Path(path), result.parent / path]
    if folder is not None:
        places = [folder / path, folder / Path(path).name]
    for place in places:
        if place.exists():
            return place
    looked = ", ".join(dict.fromkeys(str(place.absolute()) for place in places))
    raise DataError(
        f"{path}: an input of this result is not there (looked for {looked}); name "
        "its folder by --inputs",
        code="input_missing",
    )


def run_again(
    session: CommandSession, summary: dict[str, Any], found: dict[str, Path]
) -> "Identification":
    """The same analysis of the same files."""
    from pushfit.data.tables.peak_table import read_table
    from pushfit.explore.advice import with_next_push
    from pushfit.fit.identify.identify_table import identify_table
    from pushfit.fit.identify.progress import Stages, stages_of

    config, recipe = recorded_config(summary), summary["recipe"]
    if recipe["table"] is None:
        recordings = [found[path] for path in recipe["recordings"]]
        schedules = [found[path] for path in recipe["schedules"]]
        table = load_peaks(session, recordings, schedules, config=config)
    else:
        table = read_table(found[recipe["table"]])
    engine = summary["posterior"]["engine"]
    with session.progress() as progress:
        stages = Stages([*stages_of(config, engine), "next push"], progress)
        again = identify_table(
            table, config, seed=summary["seed"], engine=engine, stages=stages
        )
        stages.begin("next push")
        return with_next_push(again)


def recorded_config(summary: dict[str, Any]) -> "GraspConfig":
    """Settings that a result was made with."""
    from pydantic import ValidationError

    from pushfit.config import GraspConfig

    try:
        return GraspConfig.model_validate(summary["recipe"]["config"])
    except ValidationError as error:
        raise ConfigError(
            f"the config in summary.json is not understood: {error.errors()[0]['msg']}"
            "; use the version of pushfit that wrote it",
            code="recorded_config",
        ) from error


def as_document(
    comparison: "Reproduction", found: dict[str, Path]
) -> dict[str, object]:
    """What `--json` prints."""
    from pushfit.report.json_values import json_safe

    return {
        "schema": SCHEMA,
        "status": "reproduced" if comparison.is_reproduced else "differs",
        "is_exact": comparison.is_exact,
        "n_numbers": comparison.n_numbers,
        "differences": json_safe(comparison.differences),
        "environment": json_safe(comparison.environment),
        "inputs": {name: str(path) for name, path in found.items()},
    }


def sentences(comparison: "Reproduction") -> list[str]:
    """Verdict, worst differences and versions, as `print` is to show them."""
    from pushfit.report.strings import printable

    differences = comparison.differences
    n, refused = comparison.n_numbers, [d for d in differences if not d.is_tolerated]
    if comparison.is_exact:
        lines = [f"all {n} numbers reproduced exactly"]
    elif comparison.is_reproduced:
        lines = [f"all {n} numbers reproduced as far as other versions allow"]
    else:
        lines = [f"not reproduced: {len(refused)} of {n} numbers and words differ"]
    for difference in (refused or differences)[:N_SHOWN]:
        size = f"{difference.relative:.1e}"
        lines.append(
            f"  {difference.where}: {difference.recorded!r} recorded, "
            f"{difference.found!r} now (relative difference {size})"
        )
    for name, (old, new) in comparison.environment.items():
        lines.append(f"  {name}: {old or 'unknown'} then, {new or 'none'} now")
    if refused and not comparison.environment:
        lines.append("versions and platform are the same, so all should be identical")
    return [printable(line) for line in lines]
