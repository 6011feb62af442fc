"""What callers give, beside the types that a function says it takes.

A frame in place of what a reader makes of it would otherwise end deep inside, by the
name of an attribute. Excluded: shapes of arrays and numbers out of range
(`pushfit.mechanics.ranges`).
"""

import functools
import inspect
import typing
from collections.abc import Callable, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, ParamSpec, SupportsFloat, SupportsIndex, TypeVar

from pushfit.errors import ConfigError

Given = ParamSpec("Given")
Returned = TypeVar("Returned")
# A list will do for a tuple, and any number for a float.
ALSO: dict[Any, tuple[type, ...]] = {
    tuple: (tuple, list),
    float: (SupportsFloat,),
    int: (SupportsIndex,),
}
# What some are called.
NAMES: dict[Any, str] = {NoneType: "None", Path: "path", float: "number"}
# What is given where an array will do, by the names of types.
ARRAYS = ("ndarray", "Array")
MANY = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
# Where to get one of these.
SOURCES = {
    "GraspConfig": "`read_config` gives one",
    "Generator": "`numpy.random.default_rng(seed)` gives one",
    "Grasp": "`Grasp(push_length=0.005)` is one",
    "Parameters": "`Parameters(K_sn=..., K_dn=..., ...)` is one",
    "PeakSettings": "`read_config(...).peaks` is one",
    "PeakTable": "`read_table` and `extract_peaks` give one, and of a DataFrame "
    "`PeakTable.from_frame`",
    "PushSchedule": "`read_schedule` gives one",
    "Pushes": "`Pushes(theta, alpha)` is one, in radians",
    "Recording": "`read_recording` gives one",
    "Suggestion": "`Explorer.ask` gives some",
    "Workers": "`pushfit.Workers(n=4)` is one, of four processes",
    "path": "a path names a file that holds it",
}


def checked(function: Callable[Given, Returned]) -> Callable[Given, Returned]:
    """Have a function refuse what is of no type that its annotations name.

    Raises:
        ConfigError: By the name of the argument, what it is, and what to give.
    """
    signature = inspect.signature(function)
    called = function.__qualname__.removesuffix(".__init__")

    @functools.cache
    def hints() -> dict[str, Any]:
        found = typing.get_type_hints(function)
        # Of which `check_seed` says more.
        return {name: hint for name, hint in found.items() if name != "seed"}

    @functools.wraps(function)
    def call(*args: Given.args, **kwargs: Given.kwargs) -> Returned:
        try:
            given = signature.bind_partial(*args, **kwargs).arguments
        except TypeError:
            given = {}
        # What is missing, or too much, is said by the call itself.
        for name, value in given.items():
            if name in hints() and signature.parameters[name].kind not in MANY:
                _check(f"{called}: {name}", value, hints()[name])
        return function(*args, **kwargs)

    return call


def _check(place: str, value: object, hint: Any) -> None:
    if not _is_one(value, hint):
        raise ConfigError(
            f"{place} = {_shown(value)}: must be {_listed(hint)}", code="input_type"
        )
    for part in _parts(hint):
        if typing.get_origin(part) is Sequence and isinstance(value, list | tuple):
            for i, one in enumerate(value):
                _check(f"{place}[{i}]", one, typing.get_args(part)[0])


def _is_one(value: object, hint: Any) -> bool:
    """Whether a value may be what a hint asks for."""
    parts = _parts(hint)
    if any(map(_is_array, parts)):
        # Of anything else NumPy tries to make one; of None it would make NaN.
        return NoneType in parts if value is None else not isinstance(value, str)
    types = _types(hint)
    # A text is a list of its letters, too.
    fitting = (t for t in types if t is not Sequence or not isinstance(value, str))
    return not types or isinstance(value, tuple(fitting))


def _is_array(hint: Any) -> bool:
    """Whether a hint asks for an array, or for what becomes one."""
    kind = typing.get_origin(hint) or hint
    is_shape = getattr(kind, "__module__", "").startswith("jaxtyping")
    return is_shape or getattr(kind, "__name__", "") in ARRAYS


@functools.cache
def _types(hint: Any) -> tuple[type, ...]:
    """Types that a hint allows; none where it allows what no type tells."""
    found: list[type] = []
    for part in _parts(hint):
        kind = typing.get_origin(part) or part
        if kind is Any or not isinstance(kind, type):
            return ()
        found += ALSO.get(kind, (kind,))
    return tuple(found)


def _parts(hint: Any) -> tuple[Any, ...]:
    """What a hint allows, one by one."""
    is_union = typing.get_origin(hint) in (typing.Union, UnionType)
    return typing.get_args(hint) if is_union else (hint,)


def _shown(value: object) -> str:
    """A short value as it is, and of anything else what it is."""
    if value is None or isinstance(value, str | int | float):
        return repr(value)
    return _with_article(type(value).__name__)


def _listed(hint: Any) -> str:
    """What a hint asks for, and where to get it."""
    parts = _parts(hint)
    if any(map(_is_array, parts)):
        return "a number or an array of numbers" + " or None" * (NoneType in parts)
    names = list(dict.fromkeys(map(_name, parts)))
    sources = [SOURCES[name] for name in names if name in SOURCES]
    words = (name if name == "None" else _with_article(name) for name in names)
    return "; ".join([" or ".join(words), *sources])


def _name(hint: Any) -> str:
    kind = typing.get_origin(hint) or hint
    if kind in (Sequence, tuple):
        parts = _parts(typing.get_args(hint)[0])
        return f"list of {'|'.join(_name(part) for part in parts)}"
    return NAMES.get(kind) or str(kind.__name__)


def _with_article(name: str) -> str:
    return f"an {name}" if name[0] in "AEIOUaeiou" else f"a {name}"
