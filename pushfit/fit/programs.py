"""Compiled functions whose traced programs outlive the process.

Tracing and lowering a program takes longer than loading the machine code that JAX keeps
of it. Where the compile cache is on, `compiled` therefore keeps the traced program too,
in the portable form of `jax.export`, under a fingerprint of the source of pushfit, the
versions of the packages that trace, the kind of processor, and the arguments but for
the numbers in arrays; none where mechanics from outside the package are in use, whose
source may change. Loading one takes long, too, but leaves Python free: `loaded_ahead`
has a thread load what an analysis used the last time. `kept_arrays` keeps what follows
from settings alone. A file that is damaged, or cannot be written, is as good as none.
"""

import contextlib
import dataclasses
import functools
import hashlib
import inspect
import io
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future
from importlib import metadata
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, get_args, get_origin

import equinox as eqx
import jax
import numpy as np
from jax import export
from jax.core import Tracer
from jaxtyping import Array, Float

from pushfit.atomic import atomic_path
from pushfit.cache import programs_folder
from pushfit.model import as_float
from pushfit.registry import has_foreign

P = ParamSpec("P")
R = TypeVar("R")
# What takes part in tracing.
TRACED_BY = ("jax", "jaxlib", "equinox", "lineax", "optimistix")
# Calls whose form may change with the version of jaxlib, which is part of the
# fingerprint: LAPACK's solver by QR.
UNGUARANTEED = (export.DisabledSafetyCheck.custom_call("lapack_dormqr_ffi"),)
# XLA's newer code for fused loops takes twice as long to make and is no faster here,
# and nor is what LLVM takes longer to make of it beyond its first level.
jit = functools.partial(
    jax.jit,
    compiler_options={
        "xla_cpu_use_fusion_emitters": False,
        "xla_backend_optimization_level": 1,
    },
)
# Those of NumPy are handed over as they are, which takes less than an array of JAX.
ARRAYS = (jax.Array, np.ndarray)
# What names a function only within one process.
ADDRESS = " at 0x"
DIGEST_SIZE = hashlib.sha256().digest_size
# Programs that one process holds, those used last. Each takes some 200 mappings of
# memory, of which Linux has 65 530 for a process: one that met many kinds of tables
# died of it.
MAX_PROGRAMS = 128
# Files of arrays that are kept; another one replaces the oldest.
MAX_ARRAYS = 64
# Files of programs that this process has used, in order, and those that are loaded
# before they are used.
_used: dict[str, None] = {}
_ahead: dict[Path, "Future[Callable[..., Any] | None]"] = {}


def _origin(package: Path) -> str:
    """Digest of what programs are traced by."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        source = hashlib.sha256(path.read_bytes()).hexdigest()
        digest.update(f"{path.relative_to(package)} {source}\n".encode())
    for name in TRACED_BY:
        digest.update(f"{name} {metadata.version(name)}\n".encode())
    return digest.hexdigest()


PACKAGE = Path(__file__).parents[1]
# Of the source as it was imported.
ORIGIN = _origin(PACKAGE)


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays, as `eqx.filter_jit` does.

    Args:
        function: Pure function of a module, of arrays, modules of arrays, and constants
            that their `repr` tells. It returns arrays, containers of them, or a module
            that holds nothing but arrays, named in its annotation.

    Returns:
        The same function. Inside of another one, or of `jax.vmap` and `jax.grad`, it is
        a part of what is traced there.
    """
    _make_storable(inspect.get_annotations(function, eval_str=True).get("return"))

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
        return _program(function, programs_folder(), form)(*arrays)

    return call


def _make_storable(returned: object) -> None:
    """Let programs be kept that return a module of arrays."""
    for part in get_args(returned):
        _make_storable(part)
    returned = get_origin(returned) or returned
    if not (isinstance(returned, type) and issubclass(returned, eqx.Module)):
        return
    example = object.__new__(returned)
    for field in dataclasses.fields(returned):
        object.__setattr__(example, field.name, 0)
        _make_storable(field.type)
    _, constants = jax.tree.structure(example).node_data()
    with contextlib.suppress(ValueError):  # another function has seen to it
        export.register_pytree_node_serialization(
            returned,
            serialized_name=f"{returned.__module__}.{returned.__qualname__}",
            serialize_auxdata=lambda _: b"",
            deserialize_auxdata=lambda _: constants,
        )


@functools.lru_cache(MAX_PROGRAMS)
def _program(
    function: Callable[..., Any], folder: Path | None, form: tuple[Any, ...]
) -> Callable[..., Any]:
    """A function compiled for arguments of one form, from its file if there is one.

    Args:
        form: Structure of the arguments, what is no array in it, and shapes of arrays.

    Returns:
        Function of the arrays alone.
    """
    structure, constants, _, shapes = form

    def flat(*arrays: jax.Array) -> Any:
        values = iter(arrays)
        filled = [next(values) if c is None else c for c in constants]
        args, kwargs = jax.tree.unflatten(structure, filled)
        return function(*args, **kwargs)

    text = f"{function.__module__}.{function.__qualname__}{form}"
    if folder is None or ADDRESS in text or has_foreign():
        return jit(flat)
    path = folder / f"{_fingerprint(text)}-traced"
    _used[path.name] = None
    ahead = _ahead.pop(path, None)
    return (ahead and ahead.result()) or _load(path) or _trace(flat, shapes, path)


def _fingerprint(text: str) -> str:
    """Name of a program: where it comes from, where it runs, and what it is given."""
    parts = (ORIGIN, jax.default_backend(), text)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _load(path: Path) -> Callable[..., Any] | None:
    """A program from its file; None where there is none, or a damaged one."""
    content = _read(path)
    if content is None:
        return None
    program = export.deserialize(bytearray(content))
    shapes = [jax.ShapeDtypeStruct(a.shape, a.dtype) for a in program.in_avals]
    return jit(program.call).lower(*shapes).compile()


def _read(path: Path) -> bytes | None:
    """Content of a file of `_write`; None where there is none, or a damaged one."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    digest, kept = content[:DIGEST_SIZE], content[DIGEST_SIZE:]
    return kept if hashlib.sha256(kept).digest() == digest else None


def _write(path: Path, content: bytes) -> None:
    """Keep something that follows from the source, if it can be."""
    # Source that was edited since would put this under another's name.
    if _origin(PACKAGE) == ORIGIN:
        with contextlib.suppress(OSError), atomic_path(path) as temporary:
            temporary.write_bytes(hashlib.sha256(content).digest() + content)


def _trace(
    function: Callable[..., R], shapes: Iterable[tuple[Any, Any]], path: Path
) -> Callable[..., R]:
    """Trace a function of arrays and keep the program, if it can be."""
    jitted = jit(function)
    arrays = [jax.ShapeDtypeStruct(*one) for one in shapes]
    try:
        traced = export.export(jitted, disabled_checks=UNGUARANTEED)(*arrays)
    except NotImplementedError:  # it calls back to Python
        return jitted
    except ValueError as error:
        # Other processors have linear algebra of their own.
        if "custom calls" not in str(error):
            raise
        return jitted
    _write(path, bytes(traced.serialize()))
    return jit(traced.call)


def kept_arrays(
    text: str, make: Callable[[], Mapping[str, np.ndarray]]
) -> Mapping[str, np.ndarray]:
    """Arrays that follow from a text and the source alone, made once for all processes.

    Args:
        text: What tells them from others, numbers to the last digit included.
    """
    folder = programs_folder()
    if folder is None or has_foreign():
        return make()
    path = folder / f"{_fingerprint(text)}-arrays"
    content = _read(path)
    if content is not None:
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            return dict(arrays)
    made, buffer = make(), io.BytesIO()
    np.savez(buffer, allow_pickle=False, **made)
    _write(path, buffer.getvalue())
    with contextlib.suppress(OSError):  # others may tidy up at the same time
        others = sorted(folder.glob("*-arrays"), key=lambda p: p.stat().st_mtime)
        for old in others[:-MAX_ARRAYS]:
            old.unlink()
    return made


@contextlib.contextmanager
def loaded_ahead(analysis: str) -> Iterator[bool]:
    """Load what an analysis used the last time, while it has other things to do.

    Its context is whether one of that name ended before, so that programs are kept.

    Args:
        analysis: Name of it.
    """
    folder, before = programs_folder(), set(_used)
    content = None if folder is None else _read(_mark(folder, analysis))
    if folder is not None and content is not None:
        paths = [folder / name for name in content.decode().split()]
        _load_ahead([path for path in paths if path.name not in before])
    yield content is not None
    own = [name for name in _used if name not in before]
    # What is in memory from earlier ones is no part of it.
    if folder is not None and (own or content is None):
        _write(_mark(folder, analysis), "\n".join(own).encode())


def _load_ahead(paths: list[Path]) -> None:
    """Load programs in turn, on a thread."""
    _ahead.update({path: Future() for path in paths})
    futures = [(path, _ahead[path]) for path in paths]

    def load() -> None:
        for path, future in futures:
            program = None
            # What a program returns may be known only to the module that uses it, which
            # loads it then; so does who meets another error.
            with contextlib.suppress(Exception):
                if threading.main_thread().is_alive():
                    program = _load(path)
            future.set_result(program)

    threading.Thread(target=load).start()


def _mark(folder: Path, name: str) -> Path:
    return folder / f"{_fingerprint(name)}-run"


def in_chunks(
    function: Callable[[Array], Array], x: Float[np.ndarray, "n p"], size: int
) -> np.ndarray:
    """Function of rows, evaluated at one shape: every new one would be compiled.

    Args:
        function: Function of `size` points at a time.
        x: Points, as many as there are.
        size: Rows per call.
    """
    n = len(x)
    padded = np.concatenate([x, np.repeat(x[-1:], -n % size, axis=0)])
    # All calls are sent off before the first is waited for.
    starts = range(0, len(padded), size)
    parts = [function(as_float(padded[i : i + size])) for i in starts]
    return np.concatenate([np.asarray(part) for part in parts])[:n]
