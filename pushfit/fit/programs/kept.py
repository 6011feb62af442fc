"""Files that follow from the source of pushfit, and outlive the process.

Each is named by a fingerprint: of the source, the versions of the packages that trace,
the kind of processor, and what tells it from others. `kept` keeps what follows from
settings alone. A file that is damaged, or cannot be written, is as good as none.
Excluded: where the files are (`pushfit.fit.programs.folder`), and programs
(`pushfit.fit.programs.compile`).
"""

import contextlib
import functools
import hashlib
import os
import pickle
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import TypeVar

import jax
import numpy as np

from pushfit.atomic import atomic_path
from pushfit.fit.programs.folder import programs_folder
from pushfit.mechanics.registry import has_foreign

R = TypeVar("R")
# What takes part in tracing and compiling.
TRACED_BY = ("blackjax", "jax", "jaxlib", "equinox", "lineax", "optimistix")
DIGEST_SIZE = hashlib.sha256().digest_size
# Files of each kind that are kept, by their endings; another one replaces the oldest.
MAX_FILES = {"program": 512, "traced": 4096, "kept": 64, "run": 512}


def _origin(package: Path) -> str:
    """Digest of what programs are traced by."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        source = hashlib.sha256(path.read_bytes()).hexdigest()
        digest.update(f"{path.relative_to(package)} {source}\n".encode())
    for name in TRACED_BY:
        digest.update(f"{name} {metadata.version(name)}\n".encode())
    return digest.hexdigest()


PACKAGE = Path(__file__).parents[2]
# Of the source as it was imported.
ORIGIN = _origin(PACKAGE)


def kept(text: str, make: Callable[[], R]) -> R:
    """What follows from a text and the source alone, made once for all processes.

    Args:
        text: What tells it from others, numbers to the last digit included.
    """
    folder = programs_folder()
    if folder is None or has_foreign():
        return make()
    path = folder / f"{fingerprint_here(ORIGIN, text)}-kept"
    content = read_kept(path)
    if content is not None:
        return pickle.loads(content)
    made = make()
    write_kept(path, pickle.dumps(made))
    return made


def fingerprint_here(*parts: str) -> str:
    """Digest of texts, and of where machine code made from them runs."""
    parts = (*_processor(), os.environ.get("XLA_FLAGS", ""), *parts)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


@functools.cache
def _processor() -> tuple[str, ...]:
    """What machine code depends on; another processor may lack some instructions."""
    features = np.show_config(mode="dicts")["SIMD Extensions"]
    device = jax.devices()[0]
    version = metadata.version("jaxlib")
    return (jax.default_backend(), device.device_kind, version, str(features))


def read_kept(path: Path) -> bytes | None:
    """Content of a file of `write_kept`; None where there is none, or a damaged one."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    digest, kept = content[:DIGEST_SIZE], content[DIGEST_SIZE:]
    return kept if hashlib.sha256(kept).digest() == digest else None


def write_kept(path: Path, content: bytes) -> None:
    """Keep something that follows from the source, if it can be."""
    # Source that was edited since would put this under another's name.
    if _origin(PACKAGE) != ORIGIN:
        return
    with contextlib.suppress(OSError), atomic_path(path) as temporary:
        temporary.write_bytes(hashlib.sha256(content).digest() + content)
    kind = path.name.rpartition("-")[2]
    with contextlib.suppress(OSError):  # others may tidy up at the same time
        alike = sorted(path.parent.glob(f"*-{kind}"), key=lambda p: p.stat().st_mtime)
        for old in alike[: -MAX_FILES[kind]]:
            old.unlink()
