"""The text of `grasp.toml`: read it, say what is wrong with it, write a template.

Excluded: what the sections may say (`pushfit.config.schema`).
"""

import difflib
import inspect
import json
import re
import textwrap
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from pushfit.arguments import checked
from pushfit.config.schema import GraspConfig
from pushfit.config.section import Section
from pushfit.errors import ConfigError, InputProblem

Settings = GraspConfig | str | Path | Mapping[str, object]
HEADER = """\
# What is known about the grasp and the sensor. Keys that take effect show their
# defaults; a key behind a '#' is an example and has no effect.
"""

# Tables whose keys are the user's own, such as channels.
_OPEN_TABLES = ("map", "unit", "calibration")
_UNCHANGED: Mapping[str, Mapping[str, object]] = MappingProxyType({})
CODES = {"extra_forbidden": "unknown_key", "missing": "missing_key"}


@checked
def read_config(
    path: str | Path | None,
    *,
    profile: str | Path | None = None,
    changes: Mapping[str, Mapping[str, object]] = _UNCHANGED,
) -> GraspConfig:
    """Read and check a `grasp.toml`; what it does not state has its default.

    Args:
        path: File to read; None gives the defaults.
        profile: File of the same form with what a laboratory always states; `path`
            has the last word.
        changes: Keys by section, over both files.

    Returns:
        All settings, each section checked against the others.

    Examples:
        >>> config = read_config(None, changes={"push": {"length_mm": 4.0}})
        >>> config.push.length_mm
        4.0

    Raises:
        ConfigError: A file cannot be read, is no TOML, or breaks a rule.
    """
    files = [str(source) for source in (profile, path) if source is not None]
    content: dict[str, object] = {}
    for source in files:
        text = _text_of(source)
        # Each file is to be valid by itself, so that a message names the right one.
        parse_config(text, path=source)
        content = _merged(content, tomllib.loads(text))
    if changes:
        content = _merged(content, changes)
    return config_of(content, " and ".join(files) or "command line")


def _merged(
    base: Mapping[str, object], other: Mapping[str, object], depth: int = 0
) -> dict[str, object]:
    """Tables in tables, key by key; what is no table, and a prior, is replaced."""
    merged = dict(base)
    for key, value in other.items():
        old = merged.get(key)
        is_open = depth == 0 or key in _OPEN_TABLES
        if is_open and isinstance(old, Mapping) and isinstance(value, Mapping):
            merged[key] = _merged(old, value, depth + 1)
        else:
            merged[key] = value
    return merged


def _text_of(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise ConfigError(
            f"{path}: cannot be read: {reason}; `pushfit init` writes a fresh one",
            code="config_unreadable",
        ) from error


def parse_config(text: str, *, path: str) -> GraspConfig:
    """Check the text of a `grasp.toml`.

    Raises:
        ConfigError: The text is no TOML or breaks a rule.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(
            f"{path}: not valid TOML: {error}; text needs quotes, numbers a decimal "
            "point, and every key may stand once",
            code="config_syntax",
        ) from error
    return config_of(content, path)


def config_of(content: Mapping[str, object], path: str = "config") -> GraspConfig:
    """Check settings that may be no file.

    Args:
        content: Sections as in `grasp.toml`, for example `{"push": {"length_mm": 5}}`.
        path: Where they are from, for messages.

    Raises:
        ConfigError: They break a rule.
    """
    try:
        return GraspConfig.model_validate(content)
    except ValidationError as error:
        found = tuple(problems(error, content, path))
        text = "\n".join(one.message for one in found)
        raise ConfigError(text, code=found[0].code, problems=found) from error


def as_config(config: Settings | None) -> GraspConfig:
    """Settings, however they are given.

    Args:
        config: File, its content, the settings themselves, or None for the defaults.

    Raises:
        ConfigError: They cannot be read or break a rule.
    """
    if isinstance(config, GraspConfig):
        return config
    if isinstance(config, Mapping):
        return config_of(config)
    return read_config(config)


def template(config: GraspConfig | None = None) -> str:
    """Text of a commented `grasp.toml` that means the same as some settings.

    Returns:
        TOML: keys carry what was stated or their defaults, or stand behind a '#' with
        an example.
    """
    stated = {} if config is None else _stated(config)
    lines = [HEADER]
    for name, section in GraspConfig.model_fields.items():
        model, own = _section_of(section.annotation), stated.get(name, {})
        lines += [*_comment(model.__doc__ or ""), f"[{name}]"]
        for key, field in model.model_fields.items():
            lines += _comment(field.description or "")
            value = field.examples[0] if field.examples else field.default
            is_example = field.examples and key not in own
            value = own.get(key, value)
            lines.append(f"{'#' if is_example else ''}{key} = {as_toml(value)}")
        lines.append("")
    return "\n".join(lines)


def _stated(config: GraspConfig) -> dict[str, dict[str, object]]:
    """Keys that a file or an option gave, by section."""
    return config.model_dump(mode="json", exclude_unset=True, exclude_none=True)


def _comment(text: str) -> list[str]:
    return [
        f"# {line}"
        for paragraph in inspect.cleandoc(text).split("\n\n")
        for line in textwrap.wrap(paragraph, width=78)
    ]


def problems(
    error: ValidationError,
    content: Mapping[str, object],
    path: str,
    *,
    model: type[BaseModel] = GraspConfig,
) -> Iterator[InputProblem]:
    """One problem per key, however many alternatives of a union it failed.

    Args:
        model: What the content is not.
    """
    by_key: dict[tuple[str, ...], list[ErrorDetails]] = {}
    for detail in error.errors():
        by_key.setdefault(_key_in_file(detail["loc"], content), []).append(detail)
    for key, details in by_key.items():
        found: object = content
        for part in key:
            found = found.get(part) if isinstance(found, Mapping) else None
        value = None if isinstance(found, Mapping | None) else as_toml(found)
        name = ".".join(key)
        shown = name if value is None else f"{name} = {value}"
        rule = " or ".join(dict.fromkeys(_rule(d, key, found, model) for d in details))
        yield InputProblem(
            code="config_" + CODES.get(details[0]["type"], "value"),
            message=": ".join(part for part in (path, shown, rule) if part),
            path=path,
            column=name,
            value=value,
        )


def _key_in_file(
    location: Sequence[int | str], content: Mapping[str, object]
) -> tuple[str, ...]:
    """Path of the key that the user wrote, without list indices and union branches."""
    path: list[str] = []
    node: object = content
    for part in location:
        if not isinstance(node, Mapping):
            break
        path.append(str(part))
        node = node.get(path[-1])
    return tuple(path)


def _rule(
    detail: ErrorDetails, key: tuple[str, ...], found: object, model: type[BaseModel]
) -> str:
    match detail["type"]:
        case "extra_forbidden":
            return f"unknown key; {_suggestion(key, model)}"
        case "missing":
            return "is missing; add it" if found is None else "has too few values"
        case "value_error":
            return str(detail.get("ctx", {})["error"])
        case "tuple_type":
            is_item = isinstance(detail["loc"][-1], int)
            pairs = "of pairs, such as [[12.0, 13.5]]"
            return f"must be a list {pairs if is_item else 'in brackets'}"
        case "model_type" | "dict_type":
            return "must be a table, { key = value }"
        case _:
            rule = detail["msg"].replace("Input should be", "must be")
            return rule.replace("a valid number", "a number")


def _suggestion(key: tuple[str, ...], model: type[BaseModel]) -> str:
    """The key that was probably meant, or all that there are."""
    for part in key[:-1]:
        # The keys of an open table are no fields.
        if part in model.model_fields:
            model = _section_of(model.model_fields[part].annotation)
    names = list(model.model_fields)
    close = difflib.get_close_matches(key[-1], names, n=1)
    if close:
        return f"did you mean {close[0]}?"
    return f"known here: {', '.join(names)}"


def _section_of(annotation: object) -> type[BaseModel]:
    """The section in an annotation such as ``PositivePrior | None``."""
    candidates = get_args(annotation) or (annotation,)
    return next(a for a in candidates if isinstance(a, type) and issubclass(a, Section))


def as_toml(value: object) -> str:
    """A value as grasp.toml has it."""
    match value:
        case str() | bool():
            return json.dumps(value, ensure_ascii=False)
        case Mapping():
            pairs = (f"{_key(key)} = {as_toml(item)}" for key, item in value.items())
            return f"{{ {', '.join(pairs)} }}"
        case list() | tuple():
            return f"[{', '.join(as_toml(item) for item in value)}]"
        case _:
            return str(value)


def _key(name: object) -> str:
    """A key as TOML writes it; names of channels may hold anything."""
    text = str(name)
    return text if re.fullmatch(r"[A-Za-z0-9_-]+", text) else as_toml(text)
