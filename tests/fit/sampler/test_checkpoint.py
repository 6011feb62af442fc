"""Checkpoints: the same bits back, or kept aside and said so."""

import os

import numpy as np
import pytest

from pushfit.errors import ConfigError
from pushfit.fit.sampler import checkpoint
from pushfit.fit.sampler.checkpoint import (
    CheckpointWarning,
    check_checkpoint,
    fingerprint,
    load_checkpoint,
    save_checkpoint,
)

ARRAYS = {"chain": np.arange(12.0).reshape(3, 4), "key": np.arange(5, dtype=np.uint32)}
QUESTION = fingerprint({"data": np.ones(3)}, 0)


@pytest.fixture
def path(tmp_path):
    target = tmp_path / "run.npz"
    save_checkpoint(target, ARRAYS, question=QUESTION)
    return target


def is_set_aside(path, word):
    """Nothing loaded, nothing lost, and the reason named."""
    content = path.read_bytes()
    with pytest.warns(CheckpointWarning, match=word):
        loaded = load_checkpoint(path, question=QUESTION)
    bad = path.with_name(f"{path.name}.bad")
    return loaded is None and not path.exists() and bad.read_bytes() == content


def test_what_was_saved_comes_back_bit_by_bit(path):
    loaded = load_checkpoint(path, question=QUESTION)
    assert set(loaded) == set(ARRAYS)
    for name, array in ARRAYS.items():
        assert loaded[name].dtype == array.dtype
        np.testing.assert_array_equal(loaded[name], array)


def test_a_checkpoint_is_kept_behind_a_link(tmp_path):
    link = tmp_path / "link.npz"
    link.symlink_to("real.npz")
    save_checkpoint(link, ARRAYS, question=QUESTION)
    assert link.is_symlink()
    assert set(load_checkpoint(tmp_path / "real.npz", question=QUESTION)) == set(ARRAYS)


def test_a_folder_is_refused_before_it_would_be_set_aside(tmp_path):
    with pytest.raises(ConfigError, match="is a folder; name a file"):
        check_checkpoint(tmp_path)


def test_no_file_is_no_checkpoint(tmp_path):
    assert load_checkpoint(tmp_path / "none.npz", question=QUESTION) is None


def test_an_empty_file_is_kept_aside(path):
    path.write_bytes(b"")
    assert is_set_aside(path, "cannot be read")


def test_a_truncated_file_is_kept_aside(path):
    path.write_bytes(path.read_bytes()[:-40])
    assert is_set_aside(path, "cannot be read")


def test_a_flipped_byte_is_kept_aside(path):
    content = bytearray(path.read_bytes())
    # Inside the numbers of the first array, past the headers of zip and npy.
    where = content.find(ARRAYS["chain"].tobytes()) + 17
    content[where] ^= 0xFF
    path.write_bytes(bytes(content))
    assert is_set_aside(path, "cannot be read")


def test_an_array_of_objects_is_never_unpickled(path):
    np.savez(path, header=np.array([{}], dtype=object), allow_pickle=True)
    assert is_set_aside(path, "cannot be read")


def test_a_file_without_header_is_kept_aside(path):
    np.savez(path, **ARRAYS)
    assert is_set_aside(path, "cannot be read")


def test_another_question_is_kept_aside(path):
    save_checkpoint(path, ARRAYS, question="other")
    # Digests would say nothing to anybody.
    assert is_set_aside(path, "other data, settings or another seed; it is kept")


def test_another_version_is_kept_aside(path, monkeypatch):
    monkeypatch.setattr("pushfit.__version__", "0.0.0")
    assert is_set_aside(path, "another version")


def test_another_format_is_kept_aside(path, monkeypatch):
    monkeypatch.setattr(checkpoint, "FORMAT", 0)
    assert is_set_aside(path, "another format")


def test_earlier_bad_files_are_not_overwritten(path):
    first = path.with_name(f"{path.name}.bad")
    first.write_text("earlier")
    path.write_bytes(b"")
    with pytest.warns(CheckpointWarning, match=r"run\.npz\.bad2"):
        assert load_checkpoint(path, question=QUESTION) is None
    assert first.read_text() == "earlier"


def test_a_death_while_writing_leaves_the_old_checkpoint(path, monkeypatch):
    def die(source, target):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", die)
    with pytest.raises(KeyboardInterrupt):
        save_checkpoint(path, {"chain": np.zeros(3)}, question=QUESTION)
    monkeypatch.undo()
    np.testing.assert_array_equal(
        load_checkpoint(path, question=QUESTION)["chain"], ARRAYS["chain"]
    )
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize(
    "other",
    [
        ({"data": np.ones(3)}, 1),
        ({"data": np.nextafter(np.ones(3), 2)}, 0),
        ({"data": np.ones((3, 1))}, 0),
        ({"heights": np.ones(3)}, 0),
        ({"data": np.ones(3, dtype=np.float32)}, 0),
    ],
    ids=["seed", "last bit", "shape", "name", "type"],
)
def test_fingerprints_differ_in_every_detail(other):
    assert fingerprint(*other) != QUESTION
