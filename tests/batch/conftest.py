"""What tests of batches know of the tables that were computed."""

import pytest

from tests.batch import fake


@pytest.fixture
def log(tmp_path, monkeypatch):
    """Names of the tables that were computed, in order."""
    path = tmp_path / "log.txt"
    monkeypatch.setenv(fake.LOG, str(path))
    return lambda: path.read_text().split() if path.exists() else []
