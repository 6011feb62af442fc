"""What pushfit raises when it cannot go on.

Every error names the place, the value found, the rule and the next step. `code` is a
stable word that scripts may test; the sentence may change between versions. A posterior
that has not converged is a status (see `pushfit.fit.results`), and an error where that
is asked for; a fit without an optimum is a `FitError`. Excluded: warnings, which stop
nothing (`pushfit.fit.assess.warnings`).
"""

import contextlib
import copyreg
import difflib
import numbers
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar


def stated(**arguments: object) -> str:
    """Arguments in a message, as they are written in Python.

    The command line shows its own options instead, see `pushfit.cli.wording`.
    """
    return f"`{', '.join(f'{name}={value!r}' for name, value in arguments.items())}`"


def did_you_mean(text: str, known: Collection[str]) -> str:
    """Give the end of a sentence that names the nearest known word, if one is near."""
    near = difflib.get_close_matches(text, list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def installed_by(extra: str) -> str:
    """How to get the libraries of an extra, as pushfit itself is in no index."""
    return f"`pip install '.[{extra}]'` in the checkout"


@dataclass(frozen=True, slots=True, kw_only=True)
class InputProblem:
    """One thing wrong with one place of an input.

    Args:
        code: Stable snake_case word for the kind of problem.
        message: The whole sentence for the user: place, value, rule, next step.
        path: File as the user named it, if there is one.
        line: Line of the file, counted from 1.
        column: Column or key.
        value: The text found.
    """

    code: str
    message: str
    path: str | None = None
    line: int | None = None
    column: str | None = None
    value: str | None = None


class PushfitError(Exception):
    """Base of all errors that a user can mend; `is_placed` where `placed_in` named one.

    Args:
        message: Place, value, rule and next step in one sentence.
        code: Stable snake_case word for the kind of error.
        problems: Everything that was found wrong, when it is more than one thing.
    """

    exit_code: ClassVar[int] = 1
    is_placed = False

    def __init__(
        self, message: str, *, code: str, problems: tuple[InputProblem, ...] = ()
    ) -> None:
        """Keep the sentence, its code and the problems behind it."""
        super().__init__(message)
        self.code = code
        self.problems = problems

    def __reduce__(self) -> tuple[Any, ...]:
        """Go from process to process: without it only what is positional does."""
        return copyreg.__newobj__, (type(self), *self.args), vars(self)  # type: ignore[attr-defined]


class ConfigError(PushfitError):
    """The command line or `grasp.toml` asks for something that cannot be."""

    exit_code = 2


class SettingsError(ConfigError):
    """Settings that are valid by themselves do not go with the data."""


class DataError(PushfitError):
    """An input file or table breaks a rule."""

    exit_code = 3


class FitError(PushfitError):
    """No trustworthy numbers could be computed from accepted input.

    Args:
        names: Coordinates of the points, in their order.
        points: Where the solver stopped, best first; none where it did not begin.
        costs: Sum of squared weighted residuals at each point.
    """

    exit_code = 4

    def __init__(
        self,
        message: str,
        *,
        code: str,
        problems: tuple[InputProblem, ...] = (),
        names: tuple[str, ...] = (),
        points: Sequence[Sequence[float]] = (),
        costs: Sequence[float] = (),
    ) -> None:
        """Keep what was found beside the sentence."""
        super().__init__(message, code=code, problems=problems)
        self.names, self.points, self.costs = names, points, costs


class ConvergenceError(FitError):
    """Draws from the posterior cannot be trusted."""


@contextlib.contextmanager
def placed_in(place: str, *, only: type[PushfitError] = PushfitError) -> Iterator[None]:
    """Have errors that do not name a place begin with it.

    Args:
        place: File, or what else the input is called; empty where it has no name.
        only: Which errors.
    """
    try:
        yield
    except only as error:
        if place and not error.is_placed and place not in str(error):
            error.args, error.is_placed = (f"{place}: {error}",), True
        raise


def check_seed(seed: int) -> None:
    """Refuse what seeds no generator of random numbers.

    Raises:
        ConfigError: It is below 0, or no whole number.
    """
    if not isinstance(seed, numbers.Integral) or seed < 0:
        raise ConfigError(
            f"seed = {seed!r}: a seed is a whole number, 0 or above", code="seed"
        )


def counted(n: int, noun: str) -> str:
    """Number of things, one of which is called by a noun."""
    end = "es" if noun.endswith("sh") else "s"
    return f"{n} {noun}{'' if n == 1 else end}"
