"""Programs outlive the process, and never stand in for another one."""

import dataclasses
import functools
import os
import shutil
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import pytest
from jax.experimental.compilation_cache import compilation_cache
from jaxtyping import Array, Float

from pushfit.data.simulate import simulate_table
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.programs import compile as programs
from pushfit.fit.programs import folder as cache
from pushfit.fit.programs import kept as files
from pushfit.fit.programs.compile import compiled
from pushfit.fit.sweep.draws import Draw
from pushfit.fit.sweep.sheet import Sheet
from pushfit.model import Grasp, Parameters
from tests.fit.tables import FRICTION_ONLY, config
from tests.oracle.integrand import Inner
from tests.tolerances import EXACT

# Longer than any of this takes, and than a thread takes to begin what it may [s].
LONG, AT_ONCE = 60.0, 0.5


class Line(eqx.Module):
    """Something with arrays and a constant."""

    slope: Float[Array, ""]
    power: int = eqx.field(static=True)


class Pair(eqx.Module):
    """Something to return."""

    value: Float[Array, " n"]
    double: Float[Array, " n"]


@pytest.fixture
def jax_keeps():
    """Where JAX keeps what it compiles from now on; None if it keeps nothing."""
    before = jax.config.jax_compilation_cache_dir

    def keep(place):
        jax.config.update("jax_compilation_cache_dir", place)
        compilation_cache.reset_cache()

    yield keep
    keep(before)


@pytest.fixture
def folder(monkeypatch, tmp_path, jax_keeps):
    """Folder in which programs are kept, by pushfit alone."""
    jax_keeps(None)
    monkeypatch.setenv(cache.PROGRAMS, str(tmp_path))
    return tmp_path


def kept(folder):
    """Names of what is kept, but for the digest, in order."""
    return sorted(path.name.rpartition("-")[2] for path in folder.iterdir())


def counted():
    """A function as a new process would define it, and how often it was traced."""
    traces = []

    def line_at(line: Line, x: Float[Array, " n"]) -> Pair:
        traces.append(x.shape)
        value = line.slope * x**line.power
        return Pair(value, 2 * value)

    return compiled(line_at), traces


FRICTION = config(FRICTION_ONLY)
LINE, X = Line(jnp.asarray(3.0), 2), jnp.arange(4.0)


def test_a_later_process_does_not_trace_again(folder):
    first, traced = counted()
    later, traced_later = counted()
    np.testing.assert_array_equal(first(LINE, X).value, 3 * np.arange(4.0) ** 2)
    found = later(LINE, X)
    assert isinstance(found, Pair)
    np.testing.assert_array_equal(found.double, 6 * np.arange(4.0) ** 2)
    assert (len(traced), len(traced_later)) == (1, 0)
    assert kept(folder) == ["program", "traced"]


def test_other_source_of_the_same_program_is_traced_but_not_compiled(
    folder, monkeypatch
):
    function, _ = counted()
    function(LINE, X)
    for module in (programs, files):
        monkeypatch.setattr(module, "ORIGIN", "edited")
    monkeypatch.setattr(files, "_origin", lambda package: "edited")
    monkeypatch.setattr(jax.stages.Lowered, "compile", None)
    later, traced = counted()
    np.testing.assert_array_equal(later(LINE, X).value, 3 * np.arange(4.0) ** 2)
    assert len(traced) == 1
    assert kept(folder) == ["program", "traced", "traced"]


def test_what_returns_something_else_has_another_program(folder):
    def pair(x: Float[Array, " n"]):
        return Pair(x, 2 * x)

    def two(x: Float[Array, " n"]):
        return x, 2 * x

    assert isinstance(compiled(pair)(X), Pair)
    programs._program.cache_clear()
    assert isinstance(compiled(two)(X), tuple)
    assert isinstance(compiled(pair)(X), Pair)


def test_what_uses_another_argument_has_another_program(folder):
    def first(x: Float[Array, " n"], y: Float[Array, " n"]) -> Float[Array, " n"]:
        return 2 * x

    def second(x: Float[Array, " n"], y: Float[Array, " n"]) -> Float[Array, " n"]:
        return 2 * y

    def third(
        x: Float[Array, " n"], y: Float[Array, " m"], z: Float[Array, " n"]
    ) -> Float[Array, " n"]:
        return 2 * z

    x, y, z = np.arange(3.0), np.arange(3.0, 6.0), np.arange(6.0, 9.0)
    np.testing.assert_array_equal(compiled(first)(x, y), 2 * x)
    np.testing.assert_array_equal(compiled(second)(x, y), 2 * y)
    for few in (y, y[:2]):
        np.testing.assert_array_equal(compiled(third)(x, few, z), 2 * z)


def test_what_jax_found_in_a_cache_of_its_own_is_not_kept(folder, jax_keeps):
    """What JAX serializes of it lacks parts, and fails when it runs."""
    jax_keeps(str(folder / "jax"))

    def tall(x: Float[Array, " n"]) -> Float[Array, " n"]:
        return jnp.cumsum(jnp.sort(jnp.sin(x))) + jnp.linalg.norm(x)

    expected = np.asarray(compiled(tall)(X))
    for path in folder.glob("*-*"):
        path.unlink()
    jax.clear_caches()
    for _ in range(3):
        programs._program.cache_clear()
        np.testing.assert_array_equal(compiled(tall)(X), expected)
    assert not list(folder.glob("*-*"))


def test_other_numbers_run_through_the_same_program(folder):
    function, traced = counted()
    function(LINE, X)
    found = function(Line(jnp.asarray(5.0), 2), X + 1)
    np.testing.assert_array_equal(found.value, 5 * np.arange(1.0, 5.0) ** 2)
    assert len(traced) == 1


def test_threads_that_ask_at_the_same_time_share_one_program(folder):
    """While one traces it, the other comes, and would trace it a second time."""
    is_traced, is_traced_twice, goes_on = (threading.Event() for _ in range(3))

    def double(x: Float[Array, " n"]) -> Float[Array, " n"]:
        (is_traced_twice if is_traced.is_set() else is_traced).set()
        goes_on.wait(LONG)
        return 2 * x

    shared, x = compiled(double), jnp.arange(3.0)
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(shared, x)
        assert is_traced.wait(LONG)
        second = pool.submit(shared, x)
        assert not is_traced_twice.wait(AT_ONCE)
        goes_on.set()
        np.testing.assert_array_equal(first.result(), second.result())


@pytest.mark.parametrize(
    ("line", "x"),
    [
        (Line(jnp.asarray(3.0), 3), X),
        (LINE, jnp.arange(5.0)),
        (LINE, jnp.arange(4)),
        (LINE, np.arange(5.0)),
    ],
    ids=["constant", "shape", "dtype", "host"],
)
def test_another_question_has_another_program(folder, line, x):
    function, _ = counted()
    function(LINE, X)
    later, traced = counted()
    found = later(line, x)
    np.testing.assert_array_equal(found.value, 3 * np.asarray(x) ** line.power)
    assert len(traced) == 1


def test_a_process_holds_the_programs_that_it_used_last(monkeypatch):
    """One that held all would run out of mappings of memory."""
    monkeypatch.delenv(cache.PROGRAMS)
    assert programs._program.cache_info().maxsize is not None
    held = functools.lru_cache(2)(programs._program.__wrapped__)
    monkeypatch.setattr(programs, "_program", held)
    line_at, traces = counted()
    for n in (1, 2, 1, 3, 1, 2):
        line_at(LINE, jnp.arange(n, dtype=float))
    assert traces == [(1,), (2,), (3,), (2,)]


def test_another_source_has_another_program(folder, monkeypatch):
    function, _ = counted()
    function(LINE, X)
    for module in (programs, files):
        monkeypatch.setattr(module, "ORIGIN", "edited")
    later, traced = counted()
    later(LINE, X)
    assert len(traced) == 1


@pytest.mark.parametrize("kind", ["traced", "program"])
@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1] + bytes([content[-1] ^ 1]),
    ],
    ids=["empty", "cut", "flipped bit"],
)
def test_a_damaged_program_is_made_again(folder, damage, kind):
    function, _ = counted()
    function(LINE, X)
    (path,) = folder.glob(f"*-{kind}")
    content = path.read_bytes()
    path.write_bytes(damage(content))
    later, traced = counted()
    np.testing.assert_array_equal(later(LINE, X).value, 3 * np.arange(4.0) ** 2)
    third, traced_third = counted()
    third(LINE, X)
    assert (len(traced), len(traced_third)) == (1, 0)


def test_a_folder_that_is_gone_costs_nothing_but_time(folder):
    folder.rmdir()
    function, _ = counted()
    np.testing.assert_array_equal(function(LINE, X).value, 3 * np.arange(4.0) ** 2)


def test_nothing_is_kept_unless_asked_for(monkeypatch):
    monkeypatch.delenv(cache.PROGRAMS, raising=False)
    first, _ = counted()
    later, traced = counted()
    first(LINE, X)
    later(LINE, X)
    assert len(traced) == 1


def test_a_function_among_the_arguments_is_traced_each_time(folder):
    # Its name says nothing of what it does in another process; what is lowered does.
    applied = compiled(lambda function, x: function(x))
    np.testing.assert_array_equal(applied(lambda x: 2 * x, X), 2 * np.arange(4.0))
    np.testing.assert_array_equal(applied(lambda x: 3 * x, X), 3 * np.arange(4.0))
    assert kept(folder) == ["program", "program"]


def solution(matrix: Float[Array, "n k"], x: Float[Array, " n"], *, throw: bool):
    """By LAPACK, and where it may throw an error, by Python as well."""
    operator = lx.MatrixLinearOperator(matrix)
    return lx.linear_solve(operator, x, lx.QR(), throw=throw).value


MATRIX = np.eye(4)[:, :2] * 2


def test_a_program_that_calls_python_is_not_kept(folder):
    np.testing.assert_allclose(
        compiled(solution)(MATRIX, X, throw=True), [0.0, 0.5], rtol=EXACT, atol=EXACT
    )
    assert not list(folder.iterdir())


LATER = """
import jax
jax.config.update("jax_enable_x64", True)
import numpy as np
from pushfit.fit.programs import compile as programs
from tests.fit.programs.test_compile import MATRIX, solution
programs._compile = None
x = np.arange(4.0)
print(np.asarray(programs.compiled(solution)(MATRIX, x, throw=False)).tolist())
"""


def test_a_program_that_calls_lapack_runs_in_another_process(folder):
    x = np.arange(4.0)
    expected = np.asarray(compiled(solution)(MATRIX, x, throw=False)).tolist()
    assert kept(folder) == ["program", "traced"]
    found = subprocess.run(
        [sys.executable, "-c", LATER], capture_output=True, text=True, check=True
    )
    assert found.stdout == f"{expected}\n"


def test_an_error_of_the_function_is_not_hidden(folder):
    def wrong(x: Float[Array, " n"]) -> Float[Array, " n"]:
        raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        compiled(wrong)(X)


def test_a_part_of_another_program_is_not_kept(folder):
    function, _ = counted()
    slope = jax.grad(lambda x: jnp.sum(function(LINE, x).value))(X)
    np.testing.assert_array_equal(slope, 6 * np.arange(4.0))
    assert not list(folder.iterdir())


@pytest.mark.slow
def test_a_fit_is_the_same_to_the_last_bit(folder, monkeypatch):
    table = simulate_table(
        Parameters(K_sn=1200.0, K_dn=600.0, K_st=300.0, C_rr=0.24, C_d=0.24, L=0.04),
        Grasp(push_length=5e-3),
        theta=np.radians(np.linspace(5, 85, 9)),
        alpha=np.pi / 2,
        repeats=2,
        noise=0.03,
        rng=np.random.default_rng(0),
    )
    traced = fit_table(table, FRICTION).fit
    # From another folder programs are read again instead of remembered.
    monkeypatch.setenv(cache.PROGRAMS, str(shutil.copytree(folder, folder / "copy")))
    monkeypatch.setattr(programs, "_compile", None)
    loaded = fit_table(table, FRICTION).fit
    monkeypatch.delenv(cache.PROGRAMS)
    plain = fit_table(table, FRICTION).fit
    for fit in (traced, loaded):
        np.testing.assert_array_equal(fit.estimate, plain.estimate)
        np.testing.assert_array_equal(fit.covariance, plain.covariance)
        assert fit.chi_square == plain.chi_square


def test_source_that_was_edited_since_keeps_nothing(folder, monkeypatch):
    monkeypatch.setattr(files, "_origin", lambda package: "edited")
    function, _ = counted()
    function(LINE, X)
    assert not list(folder.iterdir())


@pytest.mark.parametrize("returned", [Inner, Draw, Sheet])
def test_what_the_engines_return_can_be_kept(folder, returned):
    def filled(x: Float[Array, " n"]):
        result = object.__new__(returned)
        for field in dataclasses.fields(returned):
            object.__setattr__(result, field.name, x)
        return result

    filled.__annotations__["return"] = returned
    compiled(filled)(X)
    (path,) = folder.glob("*-traced")
    found = programs._load(path)(X)
    assert isinstance(found, returned)
    np.testing.assert_array_equal(jax.tree.leaves(found)[0], X)


def test_child_processes_find_the_same_folder(monkeypatch, tmp_path):
    monkeypatch.setenv(cache.SWITCH, str(tmp_path / "compiled"))
    monkeypatch.setenv(cache.PROGRAMS, "")
    assert cache.programs_folder() is None
    cache.enable_compile_cache()
    assert os.environ[cache.PROGRAMS] == str(tmp_path / "compiled")
    assert cache.programs_folder() == tmp_path / "compiled"


def is_known(analysis):
    with programs.loaded_ahead(analysis) as is_kept:
        return is_kept


def test_an_analysis_is_known_once_it_has_ended(folder, monkeypatch):
    with pytest.raises(ZeroDivisionError), programs.loaded_ahead("lines"):
        raise ZeroDivisionError
    assert not is_known("lines")
    assert is_known("lines")
    assert not is_known("circles")
    # Other source has other programs.
    monkeypatch.setattr(programs, "ORIGIN", "another")
    assert not is_known("lines")


def test_what_an_analysis_used_is_loaded_before_it_is_asked_for(folder, monkeypatch):
    monkeypatch.setattr(programs, "_used", {})
    first, _ = counted()
    with programs.loaded_ahead("lines"):
        expected = first(LINE, X).value
    monkeypatch.setattr(programs, "_used", {})
    loaded, load = [], programs._load
    monkeypatch.setattr(
        programs,
        "_load",
        lambda path: loaded.append(threading.current_thread()) or load(path),
    )
    again, traces = counted()
    with programs.loaded_ahead("lines"):
        np.testing.assert_array_equal(again(LINE, X).value, expected)
    assert not traces
    assert len(loaded) == 1
    assert loaded[0] is not threading.main_thread()


def test_nothing_is_loaded_ahead_for_the_work_of_others(folder, monkeypatch):
    monkeypatch.setattr(programs, "_used", {})
    with programs.loaded_ahead("lines"):
        counted()[0](LINE, X)
    monkeypatch.setattr(programs, "_used", {})
    monkeypatch.setattr(programs, "_ahead", {})
    with programs.loaded_ahead("lines", is_here=False) as is_kept:
        assert is_kept
        assert not programs._ahead
    with programs.loaded_ahead("lines"):
        assert len(programs._ahead) == 1


def test_a_program_that_cannot_be_loaded_ahead_is_loaded_when_asked_for(
    folder, monkeypatch
):
    monkeypatch.setattr(programs, "_used", {})
    first, _ = counted()
    with programs.loaded_ahead("lines"):
        expected = first(LINE, X).value
    monkeypatch.setattr(programs, "_used", {})
    load = programs._load

    def only_in_time(path):
        if threading.current_thread() is not threading.main_thread():
            raise ValueError("not now")
        return load(path)

    monkeypatch.setattr(programs, "_load", only_in_time)
    again, traces = counted()
    with programs.loaded_ahead("lines"):
        np.testing.assert_array_equal(again(LINE, X).value, expected)
    assert not traces
