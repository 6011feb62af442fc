"""Shapes are checked once for all calls of one form.

Annotations ask for types and shapes, and in these most calls of a function are like an
earlier one: to check each of them anew took two thirds of the time of the tests.
Excluded: what annotations ask for, which is left to jaxtyping and beartype.
"""

import dataclasses
import functools
import inspect
import threading
from collections.abc import Callable, Hashable
from types import FunctionType
from typing import Any

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


def form_of(value: Any, asked: str) -> Hashable:
    """What an annotation may ask of a value.

    Args:
        asked: All annotations of its function.
    """
    kind = type(value)
    if kind is np.ndarray or isinstance(value, ARRAYS):
        return kind, value.shape, value.dtype
    if isinstance(value, dict):
        pairs = value.items()
        return kind, _one([(form_of(k, asked), form_of(v, asked)) for k, v in pairs])
    if isinstance(value, (list, tuple, set, frozenset)):
        forms = [form_of(one, asked) for one in value]
        if not isinstance(value, tuple):
            return kind, _one(forms)
        # Beside a tuple of any length there may be one of a certain length.
        return kind, (len(forms), _one(forms)) if ANY_LENGTH in asked else tuple(forms)
    if isinstance(value, type) or (
        OF_VALUES in asked and isinstance(value, (str, int))
    ):
        return kind, value
    return kind


def _one(forms: list[Hashable]) -> Hashable:
    """The form that all elements have."""
    known = frozenset(forms)
    if len(known) > 1:
        raise _Unlike
    return known


def _form_of_all(values: tuple[Any, ...], asked: str) -> Hashable | None:
    """What annotations may ask of values; None where each call has to be checked."""
    try:
        return tuple([form_of(one, asked) for one in values])
    except _Unlike:
        return None


class _Checks:
    """Checks of a function, and the forms of calls that have passed.

    Args:
        function: It, or another one of the same source.
        typechecker: Checks one call, but for shapes.
    """

    def __init__(self, function: FunctionType, typechecker: Callable[..., Any]):
        self.passed: set[Hashable] = set()
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


def _asked(function: FunctionType) -> str:
    """What annotations of a function ask for."""
    return repr([*function.__annotations__.items()])


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
    if inspect.isgeneratorfunction(function) or OF_ANYTHING in _asked(function):
        return _check(function, typechecker=typechecker)
    checks, asked = _Checks(function, typechecker), _asked(function)
    if "<locals>" in function.__qualname__:
        # Made anew by each call of the function around it.
        checks = _of_source.setdefault((function.__code__, asked), checks)
    passed, config = checks.passed, jaxtyping.config

    @functools.wraps(function)
    def call(*args, **kwargs):
        if config.jaxtyping_disable:
            return function(*args, **kwargs)
        taken = _form_of_all((*args, *kwargs.values()), asked), *kwargs
        if taken in passed:
            result = function(*args, **kwargs)
            form = taken, _form_of_all((result,), asked)
            if form in passed:
                return result
            checks(lambda *_, **__: result, args, kwargs)
        else:
            result = checks(function, args, kwargs)
            form = taken, _form_of_all((result,), asked)
        if taken[0] is not None:
            passed.add(taken)
            if form[1] is not None:
                passed.add(form)
        return result

    return call
