"""Shapes are checked once for all calls of one form.

Annotations ask for types and shapes, and in these most calls of a function are like an
earlier one: to check each of them anew took two thirds of the time of the tests.
Excluded: what annotations ask for, which is left to jaxtyping and beartype.
"""

import dataclasses
import functools
import inspect
import threading
from collections.abc import Callable, Hashable, Iterable
from types import FunctionType
from typing import Any, NamedTuple

import jax
import jaxtyping
import numpy as np

ARRAYS = (np.ndarray, np.generic, jax.Array)
# An annotation that has this asks for a certain text or number, or for any length.
OF_VALUES, ANY_LENGTH = "Literal", "..."
# And one that has this for a length that may be anything's: each call is checked.
OF_ANYTHING = "{"

_check = jaxtyping.jaxtyped


class _Unlike(Exception):
    """Elements of several forms, of which a check may look at any one."""


class Asked(NamedTuple):
    """What annotations may ask beside types and shapes.

    Args:
        values: For a certain text or number.
        any_length: For a tuple of any length.
    """

    values: bool
    any_length: bool


def form_of(value: Any, asked: Asked) -> Hashable:
    """What an annotation may ask of a value.

    Args:
        asked: By all annotations of its function.
    """
    kind = type(value)
    form = _form_by_kind.get(kind)
    if form is None:
        form = _form_by_kind[kind] = _form_of_kind(value)
    return form(value, asked)


def _form_of_kind(value: Any) -> Callable[[Any, Asked], Hashable]:
    """How the form of a value is found, and of all others of its type."""
    kind = type(value)
    if isinstance(value, ARRAYS):
        return lambda value, _: (kind, value.shape, value.dtype)
    if isinstance(value, dict):
        return lambda value, asked: (
            kind,
            _one([(form_of(k, asked), form_of(v, asked)) for k, v in value.items()]),
        )
    if isinstance(value, tuple):
        return _form_of_tuple
    if isinstance(value, (list, set, frozenset)):
        return lambda value, asked: (kind, _one([form_of(x, asked) for x in value]))
    if isinstance(value, type):
        return lambda value, _: (kind, value)
    if isinstance(value, (str, int)):
        return lambda value, asked: (kind, value) if asked.values else kind
    return lambda *_: kind


def _form_of_tuple(value: tuple[Any, ...], asked: Asked) -> Hashable:
    forms = [form_of(one, asked) for one in value]
    # Beside a tuple of any length there may be one of a certain length.
    form = (len(forms), _one(forms)) if asked.any_length else tuple(forms)
    return type(value), form


_form_by_kind: dict[type, Callable[[Any, Asked], Hashable]] = {}


def _one(forms: list[Hashable]) -> Hashable:
    """The form that all elements have."""
    known = frozenset(forms)
    if len(known) > 1:
        raise _Unlike
    return known


def _form_of_all(values: Iterable[Any], asked: Asked) -> Hashable | None:
    """What annotations may ask of values; None where each call has to be checked."""
    try:
        return tuple([form_of(one, asked) for one in values])
    except _Unlike:
        return None


class _Checks:
    """Checks of a function, and the forms of calls and results that have passed.

    Args:
        function: It, or another one of the same source.
        typechecker: Checks one call, but for shapes.
    """

    def __init__(self, function: FunctionType, typechecker: Callable[..., Any]):
        self.passed: dict[Hashable, set[Hashable]] = {}
        self._of_thread = of_thread = threading.local()

        def run(*args, **kwargs):
            return of_thread.function(*args, **kwargs)

        # Annotations that are texts are looked up where the function is.
        space, cells = function.__globals__, run.__closure__
        named = FunctionType(run.__code__, space, closure=cells)
        functools.update_wrapper(named, function)
        # Made with the first call: half of all functions have none in most processes.
        self._checked = functools.cache(lambda: _check(named, typechecker=typechecker))

    def __call__(self, function: Callable[..., Any], args, kwargs):
        """What a function returns; it, and all that the function takes, is checked."""
        self._of_thread.function = function
        try:
            return self._checked()(*args, **kwargs)
        finally:
            # Nothing outlives a call.
            self._of_thread.function = None


_of_source: dict[Hashable, _Checks] = {}


def jaxtyped(function=None, *, typechecker):
    """Decorate a class or a plain function as `jaxtyping.jaxtyped` does."""
    decorate = functools.partial(jaxtyped, typechecker=typechecker)
    if function is None:
        return decorate
    if inspect.isclass(function):
        if dataclasses.is_dataclass(function) and "__init__" in vars(function):
            function.__init__ = decorate(function.__init__)
        return function
    text = repr([*function.__annotations__.items()])
    if inspect.isgeneratorfunction(function) or OF_ANYTHING in text:
        return _check(function, typechecker=typechecker)
    checks = _Checks(function, typechecker)
    asked = Asked(OF_VALUES in text, ANY_LENGTH in text)
    if "<locals>" in function.__qualname__:
        # Made anew by each call of the function around it.
        checks = _of_source.setdefault((function.__code__, text), checks)
    passed, config = checks.passed, jaxtyping.config

    @functools.wraps(function)
    def call(*args, **kwargs):
        if config.jaxtyping_disable:
            return function(*args, **kwargs)
        taken = _form_of_all((*args, *kwargs.values()), asked), *kwargs
        returned = passed.get(taken)
        if returned is None:
            result = checks(function, args, kwargs)
            form = _form_of_all((result,), asked)
        else:
            result = function(*args, **kwargs)
            form = _form_of_all((result,), asked)
            if form in returned:
                return result
            checks(lambda *_, **__: result, args, kwargs)
        if taken[0] is not None:
            passed.setdefault(taken, set())
            if form is not None:
                passed[taken].add(form)
        return result

    return call
