"""Values as JSON knows them, no NaN, no arrays, no records; and back.

Excluded: which values are written (`pushfit.report.store.summary`).
"""

import enum
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import NoneType
from typing import Any, get_args, get_type_hints

import numpy as np
from pydantic import TypeAdapter

# Parts of lists and tables are such values, too; whoever wants one looks what it is.
Json = dict[str, object] | list[object] | str | int | float | bool | None


def json_safe(value: object) -> Json:
    """Value for JSON: NaN and infinity are null, records tables of their fields."""
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


def from_json(kind: Any, value: object) -> Any:
    """What `json_safe` made a value of, null for a number being NaN.

    Raises:
        ValueError: The value is not of that type.
    """
    return TypeAdapter(kind).validate_python(_with_nan(kind, value))


def _with_nan(kind: object, value: object) -> object:
    """JSON for a type, with NaN for null where the type is that of a number."""
    if kind is float and value is None:
        return math.nan
    if is_dataclass(kind) and isinstance(value, dict):
        hints = get_type_hints(kind)
        return {name: _with_nan(hints.get(name), part) for name, part in value.items()}
    parts = [part for part in get_args(kind) if part not in (NoneType, ...)]
    if NoneType in get_args(kind):
        return value if value is None else _with_nan(parts[0], value)
    if parts and isinstance(value, dict):
        return {name: _with_nan(parts[-1], part) for name, part in value.items()}
    if parts and isinstance(value, list):
        return [_with_nan(parts[0], part) for part in value]
    return value
