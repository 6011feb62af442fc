"""Some rows of a record whose arrays run over the same things.

Excluded: rows of a frame, which pandas takes.
"""

from dataclasses import fields, replace
from typing import TypeVar

import numpy as np
from jaxtyping import Int

T = TypeVar("T")


def rows_of(record: T, rows: slice | Int[np.ndarray, " r"]) -> T:
    """A dataclass with these rows of each of its arrays, and all else as it is."""
    own = {f.name: getattr(record, f.name) for f in fields(record)}  # pyright: ignore
    arrays = {n: a[rows] for n, a in own.items() if isinstance(a, np.ndarray)}
    return replace(record, **arrays)  # pyright: ignore
