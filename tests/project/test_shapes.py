"""Annotations with their shapes are executed, but where a module is `repeated`."""

import dataclasses
from functools import partial
from typing import Literal

import beartype
import jaxtyping
import numpy as np
import pytest
from beartype import BeartypeConf, BeartypeStrategy
from jaxtyping import Float

from pushfit.data.pushes.feet import likeness
from tests.forms import jaxtyped

TWO, THREE = np.zeros(2), np.zeros(3)
# As of the package.
checked = partial(
    jaxtyped,
    typechecker=beartype.beartype(conf=BeartypeConf(strategy=BeartypeStrategy.On)),
)


def test_shapes_are_checked():
    with pytest.raises(jaxtyping.TypeCheckError):
        likeness(TWO, THREE)


@pytest.mark.repeated
def test_shapes_are_not_checked_again_and_again():
    with pytest.raises(ValueError, match="could not be broadcast"):
        likeness(TWO, THREE)


@checked
def sums(
    x: Float[np.ndarray, " n"],
    names: list[str] | None = None,
    *,
    of: dict[str, float] | None = None,
) -> Float[np.ndarray, " n"]:
    return x if len(x) < 4 else x[:2]


@checked
def chosen(word: Literal["mean", "median"], n: int) -> Literal[1, 2]:
    return n  # pyright: ignore


@checked
def ends(pair: tuple[float, float], words: tuple[str, ...] = ()) -> None:
    pass


@checked
def made(n: int) -> Float[np.ndarray, "{n} p"]:
    return np.zeros((min(n, 3), 2))


@checked
@dataclasses.dataclass
class Pair:
    x: Float[np.ndarray, " n"]
    y: Float[np.ndarray, " n"]

    @property
    @checked
    def size(self) -> int:
        return self.x.size or "none"

    @classmethod
    @checked
    def of(cls, x: Float[np.ndarray, " n"]) -> "Pair":
        return cls(x, x)


counted = []


def counting(function):
    def check(*args, **kwargs):
        counted.append(function)
        return function(*args, **kwargs)

    return check


@partial(jaxtyped, typechecker=counting)
def same(x: np.ndarray | tuple[object, ...] | list | dict) -> object:
    return x


@partial(jaxtyped, typechecker=counting)
def doubled(x: list) -> int:
    return 2 * len(x)


@partial(jaxtyped, typechecker=counting)
def named(n: int) -> list:
    return [n, "n"]


def around(x: np.ndarray):
    @checked
    def inner(y: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        return y + x.size if y.size == x.size else x

    return inner


def of_kind(kind: type):
    @checked
    def inner(x: kind) -> kind:
        return x

    return inner


CALLS = {
    "another shape": (partial(sums, THREE), partial(sums, np.zeros((3, 1)))),
    "another type of numbers": (partial(sums, THREE), partial(sums, np.arange(3))),
    "no array": (partial(sums, THREE), partial(sums, [0.0])),
    "a shape returned": (partial(sums, THREE), partial(sums, np.zeros(4))),
    "a list of others": (partial(sums, TWO, ["a", "b"]), partial(sums, TWO, [1, 2])),
    "a dictionary of others": (
        partial(sums, TWO, of={"a": 1.0}),
        partial(sums, TWO, of={"a": "b"}),
    ),
    "an unknown word": (partial(chosen, "mean", 1), partial(chosen, "mode", 1)),
    "a number returned": (partial(chosen, "mean", 1), partial(chosen, "mean", 3)),
    "a pair beside any number": (partial(ends, (0.0, 1.0)), partial(ends, (0.0,))),
    "a length of an argument": (partial(made, 3), partial(made, 4)),
    "fields that differ": (partial(Pair, TWO, TWO), partial(Pair, TWO, THREE)),
    "a property": (lambda: Pair(TWO, TWO).size, lambda: Pair(TWO[:0], TWO[:0]).size),
    "a class method": (partial(Pair.of, TWO), partial(Pair.of, np.zeros((2, 2)))),
    "another annotation of it": (lambda: of_kind(int)(1), lambda: of_kind(str)(1)),
    "a function within another": (lambda: around(TWO)(TWO), lambda: around(TWO)(THREE)),
}


@pytest.mark.parametrize("name", CALLS)
def test_what_is_unlike_all_that_passed_is_checked(name):
    right, wrong = CALLS[name]
    right()
    right()
    for _ in range(2):
        with pytest.raises(jaxtyping.TypeCheckError):
            wrong()


def test_what_returns_another_form_for_the_same_is_checked():
    results = [THREE, THREE, TWO]

    @checked
    def drawn(x: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        return results.pop(0)

    drawn(THREE)
    drawn(THREE)
    with pytest.raises(jaxtyping.TypeCheckError):
        drawn(THREE)
    assert results == []


@pytest.mark.parametrize(
    ("function", "value", "n_expected"),
    [
        # Of what it takes, and of that with what it returns.
        (same, THREE, 2),
        (same, [1.0, 2.0], 2),
        (same, (1.0, 2.0), 2),
        # Any element is looked at, another one by another call.
        (same, [1.0, "a"], 6),
        (same, (1.0, "a"), 6),
        (same, {"a": 1.0, "b": "c"}, 6),
        (doubled, [1.0, "a"], 6),
        (named, 1, 6),
    ],
)
def test_what_is_like_all_that_passed_is_checked_once(function, value, n_expected):
    before = len(counted)
    for _ in range(3):
        function(value)
    assert len(counted) - before == n_expected
