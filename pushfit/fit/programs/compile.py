"""Compiled functions that outlive the process.

Where the compile cache is on, `compiled` keeps machine code under a digest of what was
lowered, as JAX would. Tracing and lowering take longer than loading; so that digest is
kept, too, under a fingerprint of the source and of the arguments but for the numbers in
arrays; not where these, or the source of mechanics from outside the package, say too
little. Loading takes long as well, but leaves Python free: `loaded_ahead` has threads
load what an analysis used the last time. Excluded: the files
(`pushfit.fit.programs.kept`).
"""

import contextlib
import functools
import os
import pickle
import threading
import zlib
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar

import jax
import numpy as np
from jax.core import Tracer
from jax.experimental import serialize_executable
from jaxtyping import Array, Float

from pushfit.fit.programs.devices import check_devices
from pushfit.fit.programs.folder import programs_folder
from pushfit.fit.programs.kept import ORIGIN, fingerprint_here, read_kept, write_kept
from pushfit.mechanics.registry import has_foreign
from pushfit.model import as_float

P = ParamSpec("P")
R = TypeVar("R")
# XLA's newer code for fused loops takes twice as long to make and is no faster here,
# and nor is what LLVM takes longer to make of it beyond its first level.
OPTIONS = {"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 1}
# An argument that is not used stands in the text, too: without it, functions of other
# arguments have the same one.
jit = functools.partial(jax.jit, compiler_options=OPTIONS, keep_unused=True)
# Those of NumPy are handed over as they are, which takes less than an array of JAX.
ARRAYS = (jax.Array, np.ndarray)
# What names a function only within one process.
ADDRESS = " at 0x"
# In programs that call back to Python, by an address of one process.
CALLBACK = "callback"
# In the names of what programs call to solve linear systems.
LAPACK = b"lapack"
# What JAX says of a program that it finds.
FOUND = "/jax/compilation_cache/cache_hits"
# Changes with what is in a file of machine code, which any version of pushfit may read.
FORMAT = "compressed, every argument"
# Programs that one process holds, those used last. Each takes some 200 mappings of
# memory, of which Linux has 65 530 for a process: one that met many kinds of tables
# died of it.
MAX_PROGRAMS = 128
# Threads that load programs, nearly all of it without Python: one core is left to it.
N_LOADERS = max(1, min(os.cpu_count() or 1, 4) - 1)
# Held while a program is looked up, not while it is made.
_looking_up = threading.Lock()
# Files of programs that this process has used, in order, and those that are loaded
# before they are used.
_used: dict[str, None] = {}
_ahead: dict[Path, "Future[Callable[..., Any] | None]"] = {}
# Threads whose last program JAX found in a cache of its own, if the user has one: what
# it serializes of such a program lacks parts.
_found: set[int] = set()


def _hear(event: str, **_: str | int) -> None:
    """Note the thread whose program JAX found in its own cache."""
    if event == FOUND:
        _found.add(threading.get_ident())


jax.monitoring.register_event_listener(_hear)


@dataclass(frozen=True, slots=True, kw_only=True)
class TracedProgram:
    """What is kept of a function that was traced.

    Args:
        name: Name of the file of its machine code.
        n: Arrays that it takes.
        n_returned: Arrays that it returns.
        returned: What it returns, pickled with numbers in place of arrays: modules are
            known by their names, unlike the structure of them. Machine code is loaded
            before what these need is imported.
    """

    name: str
    n: int
    n_returned: int
    returned: bytes


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays, as `eqx.filter_jit` does.

    Args:
        function: Pure function of a module, of arrays, modules of arrays, and constants
            that their `repr` tells. It returns arrays, or containers and modules of
            nothing else.

    Returns:
        The same function. Inside of another one, or of `jax.vmap` and `jax.grad`, it is
        a part of what is traced there.
    """

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        leaves, structure = jax.tree.flatten((args, kwargs))
        arrays = [leaf for leaf in leaves if isinstance(leaf, ARRAYS)]
        if any(isinstance(array, Tracer) for array in arrays):
            return function(*args, **kwargs)
        # No leaf is None, so that None can stand for an array; 1 is not True.
        constants = tuple(None if isinstance(x, ARRAYS) else x for x in leaves)
        shapes = tuple((array.shape, array.dtype) for array in arrays)
        form = (structure, constants, tuple(map(type, constants)), shapes)
        with _looking_up:
            program = _program(function, programs_folder(), form)
        return program()(*arrays)

    return call


class _Once(Generic[R]):
    """What is made when it is first asked for, by one thread for all."""

    def __init__(self, make: Callable[[], R]) -> None:
        self._make, self._making = make, threading.Lock()
        self._made: list[R] = []

    def __call__(self) -> R:
        """What was made; the first call makes it, and others wait."""
        with self._making:
            if not self._made:
                self._made.append(self._make())
        return self._made[0]


@functools.lru_cache(MAX_PROGRAMS)
def _program(
    function: Callable[..., Any], folder: Path | None, form: tuple[Any, ...]
) -> _Once[Callable[..., Any]]:
    """A program that every thread shares."""
    return _Once(lambda: _made(function, folder, form))


def _made(
    function: Callable[..., Any], folder: Path | None, form: tuple[Any, ...]
) -> Callable[..., Any]:
    """A function compiled for arguments of one form, from its file if there is one.

    Args:
        form: Structure of the arguments, what is no array in it, and shapes of arrays.

    Returns:
        Function of the arrays alone.
    """
    check_devices()
    structure, constants, _, shapes = form

    def flat(*arrays: jax.Array) -> Any:
        values = iter(arrays)
        filled = [next(values) if c is None else c for c in constants]
        args, kwargs = jax.tree.unflatten(structure, filled)
        return function(*args, **kwargs)

    text = f"{function.__module__}.{function.__qualname__}{form}"
    if folder is None:
        return jit(flat)
    if ADDRESS in text or has_foreign():
        return _compile(flat, shapes, folder)[0]
    path = folder / f"{fingerprint_here(ORIGIN, text)}-traced"
    _used[path.name] = None
    ahead = _ahead.pop(path, None)
    program = (ahead and ahead.result()) or _load(path)
    if program is None:
        program, trace = _compile(flat, shapes, folder)
        if trace is not None:
            write_kept(path, pickle.dumps(trace))
    return program


def _load(path: Path) -> Callable[..., Any] | None:
    """A program from what is kept of its trace; None where some of it is missing."""
    content = read_kept(path)
    if content is None:
        return None
    trace = pickle.loads(content)
    return _loaded(path.with_name(trace.name), trace)


def _loaded(path: Path, trace: TracedProgram) -> Callable[..., Any] | None:
    """A program from its machine code; None where there is none, or a damaged one."""
    content = read_kept(path)
    if content is None:
        return None
    code = zlib.decompress(content)
    if LAPACK in code:
        _bind_lapack()
    program = serialize_executable.deserialize_and_load(
        code,
        jax.tree.structure((tuple(range(trace.n)), {})),
        jax.tree.structure(list(range(trace.n_returned))),
        execution_devices=jax.devices()[:1],
    )
    structure = functools.cache(
        lambda: jax.tree.structure(pickle.loads(trace.returned))
    )
    return lambda *arrays: jax.tree.unflatten(structure(), program(*arrays))


@functools.cache
def _bind_lapack() -> None:
    """Have JAX hand its linear algebra to XLA, as lowering any of it does."""
    jax.jit(jax.numpy.linalg.cholesky).lower(jax.ShapeDtypeStruct((1, 1), float))


def _compile(
    function: Callable[..., R], shapes: Iterable[tuple[Any, Any]], folder: Path
) -> tuple[Callable[..., R], TracedProgram | None]:
    """Trace a function of arrays, and compile it unless its machine code is kept.

    Returns:
        The program, and what to keep of its trace; None where no machine code is kept.
    """
    arrays = [jax.ShapeDtypeStruct(*one) for one in shapes]
    lowered = jit(function).lower(*arrays)
    text, outputs = lowered.as_text(), lowered.out_tree
    if CALLBACK in text:
        return lowered.compile(), None
    trace = TracedProgram(
        name=f"{fingerprint_here(FORMAT, str(OPTIONS), text)}-program",
        n=len(arrays),
        n_returned=outputs.num_leaves,
        returned=pickle.dumps(jax.tree.unflatten(outputs, range(outputs.num_leaves))),
    )
    path = folder / trace.name
    kept = _loaded(path, trace)
    if kept is not None:
        return kept, trace
    _found.discard(threading.get_ident())
    program = lowered.compile()
    if threading.get_ident() in _found:
        return program, None
    code, _, _ = serialize_executable.serialize(program)
    write_kept(path, zlib.compress(code, level=1))
    return program, trace


@contextlib.contextmanager
def loaded_ahead(analysis: str, *, is_here: bool = True) -> Iterator[bool]:
    """Load what an analysis used the last time, while it has other things to do.

    Its context is whether one of that name ended before, so that programs are kept.

    Args:
        is_here: Whether this process does the work; nothing is loaded for others.

    Raises:
        ConfigError: JAX cannot compute here.
    """
    check_devices()
    folder, before = programs_folder(), set(_used)
    content = None if folder is None else read_kept(_mark(folder, analysis))
    if is_here and folder is not None and content is not None:
        paths = [folder / name for name in content.decode().split()]
        _load_ahead([path for path in paths if path.name not in before])
    yield content is not None
    own = [name for name in tuple(_used) if name not in before]
    # What is in memory from earlier ones is no part of it.
    if folder is not None and (own or content is None):
        write_kept(_mark(folder, analysis), "\n".join(own).encode())


def _load_ahead(paths: list[Path]) -> None:
    """Load programs in turn, on threads."""

    def load(path: Path) -> Callable[..., Any] | None:
        # Who meets an error loads it when it is used.
        with contextlib.suppress(Exception):
            if threading.main_thread().is_alive():
                return _load(path)
        return None

    pool = ThreadPoolExecutor(N_LOADERS)
    _ahead.update({path: pool.submit(load, path) for path in paths})
    pool.shutdown(wait=False)


def _mark(folder: Path, name: str) -> Path:
    return folder / f"{fingerprint_here(ORIGIN, name)}-run"


def in_chunks(
    function: Callable[[Float[Array, "k p"]], Float[Array, "k ..."]],
    x: Float[np.ndarray, "n p"],
    size: int,
) -> Float[np.ndarray, "n ..."]:
    """Function of rows, evaluated at one shape: every new one would be compiled.

    Args:
        function: Function of `size` points at a time.
    """
    n = len(x)
    padded = np.concatenate([x, np.repeat(x[-1:], -n % size, axis=0)])
    # All calls are sent off before the first is waited for.
    starts = range(0, len(padded), size)
    parts = [function(as_float(padded[i : i + size])) for i in starts]
    return np.concatenate([np.asarray(part) for part in parts])[:n]
