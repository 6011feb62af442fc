"""What the library says, in the words of the command that is running.

The library names arguments as they are written in Python: `min_height`, or
`exclude=[(12.0, 13.5)]`. Who types a command reads its option instead, or the key of
grasp.toml where the command has no such option. Excluded: how messages come to name
arguments (`pushfit.errors`).
"""

import ast
import re
import shlex
from collections.abc import Mapping, Sequence
from inspect import Parameter
from typing import get_args

from typer.models import OptionInfo

# A longer text in backticks is no argument.
_QUOTED = re.compile(r"`([^`\n]{1,300})`")


def in_options(text: str, flags: Mapping[str, str]) -> str:
    """The same text with options, as `flags_of` gives them, in place of arguments."""
    return _QUOTED.sub(lambda quoted: _translated(quoted, flags), text)


def flags_of(parameters: Sequence[Parameter]) -> dict[str, str]:
    """The long option of a command for every name that an argument may have."""
    flags = {}
    for parameter in parameters:
        for option in get_args(parameter.annotation)[1:]:
            if not isinstance(option, OptionInfo):
                continue
            # The first name takes the place of a default, which the function has.
            words = (option.default, *(option.param_decls or ()))
            stated = [w for w in words if isinstance(w, str) and w[:2] == "--"]
            long = stated or [f"--{parameter.name.replace('_', '-')}"]
            names = [word[2:].replace("-", "_") for word in long]
            flags |= dict.fromkeys([parameter.name, *names], long[0])
    return flags


def _translated(quoted: re.Match[str], flags: Mapping[str, str]) -> str:
    """Arguments in backticks as options, or as they are where one is neither."""
    from pushfit.config.file import as_toml

    options, keys = [], []
    for argument, *value in _arguments(quoted[1]):
        name = _setting(argument)
        if name in flags:
            options += [shlex.join([flags[name], *one]) for one in _values(*value)]
        elif section := _section(name):
            keys.append(" = ".join([f"{section}.{name}", *map(as_toml, value)]))
        else:
            return quoted[0]
    return " and ".join(filter(None, [" ".join(options), *keys])) or quoted[0]


def _arguments(text: str) -> list[tuple]:
    """Each name with its value, if it has one; nothing where these are no arguments."""
    try:
        call = ast.parse(f"_({text})", mode="eval").body
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name)):
            return []
        pairs = [(word.arg, ast.literal_eval(word.value)) for word in call.keywords]
        return [(word.id,) for word in call.args if isinstance(word, ast.Name)] + pairs
    except (SyntaxError, ValueError):
        return []


def _values(value: object = True) -> list[list[str]]:
    """Words after an option, once for every time that it is given."""
    if value is True:
        return [[]]
    if isinstance(value, dict):
        return [[f"{key}={one}"] for key, one in value.items()]
    if isinstance(value, list) and all(isinstance(one, tuple) for one in value):
        return [[":".join(map(str, one))] for one in value]
    return [[",".join(value) if isinstance(value, list) else str(value)]]


def _setting(argument: str) -> str:
    """What options and settings call an argument of a reader."""
    from pushfit.data.load import READER_NAMES

    return next(
        (key for key, name in READER_NAMES.items() if name == argument), argument
    )


def _section(name: str) -> str | None:
    """Section of grasp.toml that has a setting of inputs."""
    from pushfit.config.inputs import PeakSettings, RecordingSection

    sections = {"peaks": PeakSettings, "recording": RecordingSection}
    return next((own for own, of in sections.items() if name in of.model_fields), None)
