"""A result folder to read from, and tests in which nothing is drawn."""

import shutil

import pytest

from pushfit.report.store.folder import write_result_folder
from tests.report.makers import leave_out_figures


@pytest.fixture
def undrawn(monkeypatch):
    """Nothing is drawn in this test: others cover it."""
    leave_out_figures(monkeypatch)


@pytest.fixture(scope="package")
def made(make_identification, tmp_path_factory):
    """A result folder, written once."""
    with pytest.MonkeyPatch.context() as patch:
        leave_out_figures(patch)
        folder = tmp_path_factory.mktemp("stored") / "result"
        return write_result_folder(make_identification(), folder, force=False)


@pytest.fixture
def result(made, tmp_path, undrawn):
    """A copy of it to work on."""
    return shutil.copytree(made, tmp_path / "result")
