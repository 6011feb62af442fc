"""Configuration shared by all tests."""

import contextlib
import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import jax
import jaxtyping
import pytest
from hypothesis import settings

from pushfit.fit.programs import compile as compiling
from pushfit.fit.programs import folder
from pushfit.mechanics.registry import mechanics_named

# A (3,) against a (3, 1) is a mistake in the model, never a wish.
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
# Compiling is most of the cost of the tests; workers, processes that tests start, and
# later runs share what is traced and compiled. A test that replaces part of what
# `pushfit.fit.programs.compile` traces has to turn this off.
CACHE = Path(__file__).parents[1] / ".pytest_cache"
PROGRAMS, COMPILED = CACHE / "programs", CACHE / "compiled"
for path in (PROGRAMS, COMPILED):
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
os.environ[folder.SWITCH] = os.environ[folder.PROGRAMS] = str(PROGRAMS)
# For what tests compile by themselves.
jax.config.update("jax_compilation_cache_dir", str(COMPILED))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
# Objects between two searches for garbage, which take a twentieth of the time if Python
# chooses.
gc.set_threshold(50_000)
# Of one process, of which two run at once [bytes].
MAX_MEMORY = 3e9
# A gate says the same of the same code: the same examples each time, and no deadline,
# which would say how busy the machine is. --hypothesis-profile=default tries others.
settings.register_profile("gate", deadline=None, derandomize=True)
settings.load_profile("gate")


def pytest_configure(config: pytest.Config) -> None:
    """Say how programs are compiled, before the first is.

    What LLVM takes as it is is made in half of the time and runs slower, which pays
    unless tests run it thousands of times, as those marked slow do. The processes that
    tests start load what is kept, and compile the rest as users' do.
    """
    if "not slow" in config.option.markexpr:
        compiling.OPTIONS["xla_backend_optimization_level"] = 0
    # What tests compile themselves is compiled in the same way.
    flags = [f"--{name}={value}".lower() for name, value in compiling.OPTIONS.items()]
    # Once only: they are part of the name that a program is kept by; workers inherit.
    flags = dict.fromkeys([*os.environ.get("XLA_FLAGS", "").split(), *flags])
    os.environ["XLA_FLAGS"] = " ".join(flags)


@pytest.fixture(autouse=True)
def shapes(request, monkeypatch) -> None:
    """Shapes are checked, which takes a third of the time, but where it is enough.

    The tests of a module that is `repeated` go through whole recordings or explorations
    many times, by functions that other tests call as well.
    """
    if request.node.get_closest_marker("repeated"):
        monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)


@pytest.fixture(scope="module", autouse=True)
def programs() -> Iterator[None]:
    """Compiled programs are let go between modules where they take too much memory.

    Each takes some 25 MB, and the tests marked slow compile hundreds.
    """
    yield
    with contextlib.suppress(OSError):
        resident = int(Path("/proc/self/statm").read_text("ascii").split()[1])
        if resident * os.sysconf("SC_PAGE_SIZE") > MAX_MEMORY:
            compiling._program.cache_clear()
            jax.clear_caches()
            gc.collect()
            ctypes.CDLL("libc.so.6").malloc_trim(0)


@pytest.fixture
def own_mechanics(monkeypatch) -> Iterator[None]:
    """The worked example of mechanics of one's own, where Python finds it."""
    folder = Path(__file__).parents[1] / "examples" / "own_mechanics"
    monkeypatch.syspath_prepend(folder)
    yield
    sys.modules.pop("pushfit_hertz", None)
    mechanics_named.cache_clear()


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings, which is no part of the repository."""
    beside = Path(__file__).parents[1] / "../shared/data"
    folder = Path(os.environ.get("PUSHFIT_REAL_DATA", beside)).resolve()
    if not folder.is_dir():
        pytest.skip("no real recordings here; name them by PUSHFIT_REAL_DATA")
    return folder
