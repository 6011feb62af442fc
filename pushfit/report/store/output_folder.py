"""Where results may be written: checked before anything is computed for them.

Excluded: writing them (`pushfit.report.store.folder`).
"""

import itertools
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

from pushfit.atomic import check_parent, check_writable, is_stream
from pushfit.errors import ConfigError, installed_by

# How a grasp was explored, which no result makes anew: what was told, its picture, and
# the settings, what the hand says of its joints among them.
EXPLORED = ("journal.jsonl", "exploration.png", "settings.toml")
JOURNAL, EXPLORATION, SETTINGS = EXPLORED
# What every result has, and what is read back from it.
RESULT = frozenset({"result.nc", "summary.json"})
KEPT = RESULT | {"peaks.csv", JOURNAL}
CONTENT = KEPT | {"report.txt", "report.html", "figures", EXPLORATION, SETTINGS}


# What each library makes of a result.
PARTS = {"jinja2": "report.html", "corner": "corner plots"}


def left_out(*libraries: str) -> str:
    """What cannot be made because a library is missing, and how to get it.

    Args:
        libraries: Names of `PARTS`.

    Returns:
        A sentence; empty where nothing is missing.
    """
    missing = [library for library in libraries if find_spec(library) is None]
    if not missing:
        return ""
    lacking = " and ".join(PARTS[library] for library in missing)
    return (
        f"{lacking} will be left out, for want of {' and '.join(missing)}; "
        f"{installed_by('report')}"
    )


def refuse_inputs(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Protect what a command reads, even from --force.

    Raises:
        ConfigError: An output is an input, or one is a result and the other is what it
            is read back from.
    """
    read = {path.resolve() for path in inputs}
    # A result may only replace a folder that holds nothing else.
    read |= {path.parent for path in read if path.name in KEPT}
    for path in outputs:
        own = path.resolve()
        is_part = own.parent in read and own.name in KEPT
        if not is_stream(path) and (own in read or is_part):
            raise ConfigError(
                f"{path}: this command reads it, and inputs are never replaced, not "
                "even by `force=True`; name another",
                code="output_is_input",
            )


def refuse_twice(outputs: Sequence[Path]) -> None:
    """Protect one output of a command from another, even from --force.

    Raises:
        ConfigError: Two have the same name, or lead to the same place.
    """
    for one, other in itertools.combinations(outputs, 2):
        if one.resolve() == other.resolve() and not is_stream(one):
            raise ConfigError(
                f"{other}: two outputs of this command go there, and one would replace "
                "the other; name another for one of them",
                code="output_twice",
            )


def check_target(out: Path, *, force: bool, checkpoint: Path | None = None) -> None:
    """Refuse a target before anything is computed for it.

    Args:
        checkpoint: Where the same command keeps a chain; None where it keeps none.

    Raises:
        ConfigError: As in `write_result_folder`, or the checkpoint would be inside.
    """
    if checkpoint is not None and out.resolve() in checkpoint.resolve().parents:
        raise ConfigError(
            f"{checkpoint}: lies in {out}, which is replaced as a whole; name a place "
            "outside of it",
            code="output_within",
        )
    check_place(out)
    if out.exists() and not force:
        raise ConfigError(
            f"{out}: exists and is not overwritten; choose another name or use "
            "`force=True`",
            code="output_exists",
        )
    strange = _strange_content(out) if out.exists() else ""
    if strange:
        raise ConfigError(
            f"{out}: {strange} is not part of a result, so `force=True` does not "
            "remove it; choose another name or move it away",
            code="output_not_a_result",
        )
    check_writable(out)


def check_place(out: Path) -> None:
    """Refuse a name under which no folder can be made.

    Raises:
        ConfigError: It is no name, or its parent is missing.
    """
    if not out.name:
        raise ConfigError(
            f"{out}: not the name of a folder; name one to create", code="output_name"
        )
    check_parent(out)


def _strange_content(out: Path) -> str:
    """Name of something in the folder that no result has; empty if all is known."""
    if not out.is_dir():
        return out.name
    entries = {entry.name for entry in out.iterdir()}
    return min(entries - CONTENT, default="")
