"""Where compiled programs are kept: for the user alone, and said once."""

import os
import stat
from pathlib import Path

import platformdirs
import pytest

from pushfit.fit.programs import folder as cache


@pytest.fixture
def no_cache_set(monkeypatch, tmp_path):
    """Environment without a compile cache yet."""
    monkeypatch.setenv(cache.SWITCH, str(tmp_path / "compiled"))
    # Set, so that what the command sets is taken back.
    monkeypatch.setenv(cache.PROGRAMS, "")
    return tmp_path / "compiled"


def test_the_compile_cache_belongs_to_the_user_alone(no_cache_set):
    assert cache.enable_compile_cache() == str(no_cache_set)
    assert stat.S_IMODE(no_cache_set.stat().st_mode) == 0o700
    assert os.environ[cache.PROGRAMS] == str(no_cache_set)


def test_python_says_once_where_programs_are_kept(no_cache_set, caplog):
    """A new folder as a warning, which is seen without asking."""
    caplog.set_level("INFO")
    for _ in range(2):
        cache.keep_programs()
    (said,) = caplog.records
    assert said.levelname == "WARNING"
    assert str(no_cache_set) in said.message
    assert "PUSHFIT_CACHE=off" in said.message


def test_python_says_of_a_folder_that_is_known_only_who_asks(no_cache_set, caplog):
    no_cache_set.mkdir(mode=0o700)
    caplog.set_level("INFO")
    cache.keep_programs()
    assert [record.levelname for record in caplog.records] == ["INFO"]


def test_a_cache_open_to_others_is_not_used(no_cache_set):
    no_cache_set.mkdir(mode=0o755)
    assert "open to others" in cache.enable_compile_cache()
    assert cache.programs_folder() is None


def test_a_cache_that_is_a_link_is_not_used(no_cache_set, tmp_path):
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    no_cache_set.symlink_to(tmp_path / "elsewhere")
    assert cache.enable_compile_cache().startswith("off")


def test_the_cache_can_be_turned_off(no_cache_set, monkeypatch):
    monkeypatch.setenv(cache.SWITCH, "off")
    monkeypatch.setenv(cache.PROGRAMS, str(no_cache_set))
    assert cache.enable_compile_cache().startswith("off")
    assert not no_cache_set.exists()
    assert cache.programs_folder() is None


def test_without_a_word_it_is_where_the_system_keeps_such(monkeypatch):
    monkeypatch.delenv(cache.SWITCH)
    monkeypatch.setattr(
        platformdirs, "user_cache_path", Path("/home/me/.cache").joinpath
    )
    assert cache.cache_folder() == Path("/home/me/.cache/pushfit/compiled")


def test_a_folder_named_from_here_stays_where_it_is(no_cache_set, monkeypatch):
    """Processes that are started elsewhere keep their programs in the same place."""
    monkeypatch.chdir(no_cache_set.parent)
    monkeypatch.setenv(cache.SWITCH, "compiled")
    assert cache.enable_compile_cache() == str(no_cache_set)
