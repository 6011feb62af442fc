"""Arrays of an unfinished run on disk: complete or absent, and never taken for another.

A checkpoint names the question it belongs to by a fingerprint of data, model, priors
and seed, and the version that wrote it. What cannot be used is kept under another
name and said so. Excluded: what the arrays mean.
"""

import hashlib
import json
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

import pushfit
from pushfit.atomic import atomic_path, check_file, is_stream, spare_name
from pushfit.errors import ConfigError

# Raised whenever the meaning of the arrays changes.
FORMAT = 1
HEADER = "header"


class CheckpointWarning(UserWarning):
    """A checkpoint was set aside and the run starts anew."""


def check_checkpoint(path: Path) -> None:
    """Refuse a name under which no run can be kept and read back.

    Raises:
        ConfigError: It is a device, a FIFO or a folder, or its own folder does not
            exist or takes no file.
    """
    if is_stream(path):
        raise ConfigError(
            f"{path}: is no regular file, so that no run could be read back from it; "
            "name a file for `checkpoint`",
            code="checkpoint_place",
        )
    check_file(path)


def fingerprint(*trees: object) -> str:
    """Digest of pytrees, every array bit by bit and every setting, hexadecimal.

    Args:
        trees: Containers of arrays; what is not an array is compared as text.
    """
    digest = hashlib.sha256()
    leaves, structure = jax.tree.flatten(trees)
    digest.update(str(structure).encode())
    for leaf in leaves:
        array = np.asarray(leaf)
        digest.update(f"{array.dtype}{array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def save_checkpoint(
    path: Path, arrays: Mapping[str, np.ndarray], *, question: str
) -> None:
    """Replace a checkpoint in one step."""
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        contents: dict[str, Any] = dict(arrays)
        contents[HEADER] = np.array(json.dumps(_header(question)))
        np.savez(file, **contents)


def load_checkpoint(path: Path, *, question: str) -> dict[str, np.ndarray] | None:
    """Arrays of a checkpoint of the same question.

    Returns:
        The arrays; None without a file, and, with a `CheckpointWarning`, for one
        that is broken or belongs elsewhere: it is kept beside, with the ending .bad.
    """
    if not path.exists():
        return None
    try:
        # allow_pickle stays False: a checkpoint must not be able to run code.
        with path.open("rb") as handle, np.load(handle) as file:
            arrays = {name: file[name] for name in file.files}
        header = json.loads(str(arrays.pop(HEADER)))
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        _set_aside(path, f"cannot be read ({error})")
        return None
    expected = _header(question)
    found = {key: header.get(key) for key in expected}
    for key, what in (
        ("format", "has another format ({format})"),
        ("version", "was written by another version of pushfit ({version})"),
        ("question", "belongs to other data, settings or another seed"),
    ):
        if found[key] != expected[key]:
            _set_aside(path, what.format(**found))
            return None
    return arrays


def _header(question: str) -> dict[str, str | int]:
    return {"format": FORMAT, "version": pushfit.__version__, "question": question}


def _set_aside(path: Path, reason: str) -> None:
    """Rename to the first free name with .bad, and say why."""
    kept = spare_name(path)
    path.rename(kept)
    warnings.warn(
        f"checkpoint {path} {reason}; it is kept as {kept.name} and sampling starts "
        "anew",
        CheckpointWarning,
        stacklevel=3,
    )
