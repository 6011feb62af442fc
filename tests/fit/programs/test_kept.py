"""What follows from settings and source is made once, and read back as it was."""

import os

import numpy as np
import pytest

from pushfit.fit.programs import kept as files
from pushfit.fit.programs.folder import PROGRAMS
from pushfit.fit.programs.kept import kept


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """Folder in which arrays are kept."""
    monkeypatch.setenv(PROGRAMS, str(tmp_path))
    return tmp_path


def test_every_part_of_the_source_counts(tmp_path):
    package = tmp_path / "package"
    package.mkdir()
    (package / "a.py").write_text("x = 1\n")
    seen = {files._origin(package)}
    (package / "a.py").write_text("x = 2\n")
    seen.add(files._origin(package))
    (package / "a.py").rename(package / "b.py")
    seen.add(files._origin(package))
    (package / "a.py").write_text("")
    seen.add(files._origin(package))
    assert len(seen) == 4


def test_arrays_are_made_once_and_read_back_to_the_bit(folder):
    made = {"ln A": np.geomspace(1e-300, 1e300, 7), "mean": np.array(0.1)}
    assert kept("prior", lambda: made) is made
    found = kept("prior", lambda: pytest.fail("made again"))
    assert list(found) == list(made)
    for name, values in made.items():
        np.testing.assert_array_equal(found[name], values)
    assert kept("another", dict) == {}


def test_damaged_arrays_are_made_again(folder):
    kept("prior", lambda: {"mean": np.ones(3)})
    (path,) = folder.iterdir()
    path.write_bytes(path.read_bytes()[:-1])
    again = kept("prior", lambda: {"mean": np.zeros(3)})
    np.testing.assert_array_equal(again["mean"], 0.0)


def test_of_many_arrays_the_latest_are_kept(folder, monkeypatch):
    monkeypatch.setitem(files.MAX_FILES, "kept", 2)
    for number in range(4):
        kept(f"prior {number}", lambda: {"mean": np.ones(1)})
        for path in folder.iterdir():
            os.utime(path, ns=(10**9, path.stat().st_mtime_ns - 10**9))
    assert len(list(folder.iterdir())) == 2
    kept("prior 3", lambda: pytest.fail("made again"))
