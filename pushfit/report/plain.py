"""Values as JSON knows them: no NaN, no arrays, no records."""

import enum
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

Json = dict[str, Any] | list[Any] | str | int | float | bool | None


def json_safe(value: object) -> Json:
    """Value with NaN and infinity as null, and records by the names of their fields.

    Args:
        value: Records, mappings, sequences, arrays, members and scalars, nested.

    Returns:
        What `json.dumps(..., allow_nan=False)` accepts.
    """
    if is_dataclass(value):
        return {f.name: json_safe(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): json_safe(item) for key, item in value.items()}
    if isinstance(value, enum.Enum):
        return json_safe(value.value)
    if isinstance(value, np.ndarray | np.generic):
        return json_safe(value.tolist())
    if isinstance(value, list | tuple):
        return [json_safe(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str):
        # A lone surrogate, as in a file name that is not UTF-8, cannot be encoded.
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    return value if value is None or isinstance(value, int) else str(value)
