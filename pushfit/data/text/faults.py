"""How a fault of an input file is worded: place, value, rule, next step.

Excluded: which fault it is (`pushfit.data.text.explain`).
"""

from collections.abc import Iterable, Sequence
from itertools import groupby

from pushfit.errors import ConfigError, DataError, InputProblem

# What to do about columns without names.
STATE_COLUMNS = (
    "state them in order, for example `columns=['time_s', 'pressure_kpa', '...']` "
    "where ... stands for all others, and `rate=100` if none is a time"
)
# Names at least this alike are one name misspelt: `heigth` and `height` are 0.83
# alike, `height_left` and `height` 0.71, `truth.toml` and `strval.toml` 0.67.
ALIKE = 0.8
# Faults of one kind that are listed; the others are counted.
MAX_LISTED = 10


def problem(
    code: str,
    text: str,
    *,
    path: str,
    line: int | None = None,
    column: str | None = None,
    value: str | None = None,
) -> InputProblem:
    """Put the place in front of what is wrong there.

    Args:
        text: Value, rule and next step.
        line: Line, counted from 1.
    """
    place = [path]
    if line is not None:
        place.append(f"line {line}")
    if column is not None:
        place.append(f"column {column}")
    message = f"{', '.join(place)}: {text}"
    return InputProblem(
        code=code, message=message, path=path, line=line, column=column, value=value
    )


def data_error(problems: Sequence[InputProblem]) -> DataError:
    """Make the error that reports all of several problems."""
    message, *others = in_few_lines(problems)
    more = f" (and {len(others)} more)" if others else ""
    return DataError(message + more, code=problems[0].code, problems=tuple(problems))


def in_few_lines(problems: Iterable[InputProblem]) -> list[str]:
    """Messages in their order, those that differ by the line of a file alone as one."""
    lines: dict[tuple[str, str], list[int]] = {}
    for one in problems:
        before, place, after = one.message.partition(f", line {one.line}")
        of_this = lines.setdefault((before, after), [])
        if place and one.line is not None:
            of_this.append(one.line)
    return [
        f"{before}, line{'s' * (len(of_this) > 1)} {in_runs(of_this)}{after}"
        if of_this
        else before
        for (before, after), of_this in lines.items()
    ]


def refuse(code: str, text: str, *, path: str, line: int | None = None) -> DataError:
    """Make the error for the one thing that is wrong with a file."""
    return data_error([problem(code, text, path=path, line=line)])


def no_rows(path: str) -> DataError:
    """Refuse a table of names alone."""
    text = "has a header but 0 data rows; record or export it again"
    return refuse("no_rows", text, path=path)


def refuse_columns(columns: Sequence[str], names: Sequence[str], *, path: str) -> None:
    """Refuse to rename columns that have names of their own."""
    if columns:
        raise ConfigError(
            f"{path}: columns were named, but those of the file have names: "
            f"{listed(names)}; leave out columns, and state what each is for by "
            "`mapping` and `units`",
            code="columns_and_header",
        )


def refuse_too_large(
    path: str, what: str, *, needed: int, max_bytes: int, remedy: str
) -> None:
    """Refuse samples that need more memory than they may."""
    if needed > max_bytes:
        raise refuse(
            "too_large",
            f"{what} need {needed / 1e9:.3g} GB, over the limit of "
            f"{max_bytes / 1e9:.3g} GB; {remedy}, or raise max_bytes",
            path=path,
        )


def in_runs(numbers: Iterable[int]) -> str:
    """Whole numbers that increase, those in a row by the ends of it.

    Examples:
        >>> in_runs([2, 3, 4, 7])
        '2–4, 7'
    """
    # In a row, numbers less their places are equal.
    rows = groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0])
    runs = [[number for _, number in row] for _, row in rows]
    return listed([f"{r[0]}–{r[-1]}" if len(r) > 1 else f"{r[0]}" for r in runs])


def listed(texts: Sequence[str], most: int = 12) -> str:
    """Give the first of some words, and how many more there are."""
    shown = ", ".join(filter(None, texts[:most]))
    return shown + (f" and {len(texts) - most} more" if len(texts) > most else "")
