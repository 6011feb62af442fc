"""Whatever a command writes goes through links and into devices, and replaces neither.

The special file is made here: a FIFO stands for every device, since a test cannot make
one of those without being root.
"""

import os
import threading
from pathlib import Path

import pytest

from pushfit.atomic import atomic_path, is_stream
from pushfit.cli import main

EXAMPLE = Path(__file__).parents[1] / "examples" / "foam_box"
RECORDING, SCHEDULE = (
    str(EXAMPLE / name) for name in ("alpha_sweep.csv", "alpha_schedule.csv")
)
TRUTH = str(EXAMPLE / "truth.toml")
# Every command that writes single files, up to the name of the file, which follows.
WRITERS = {
    "init": ["init"],
    "peaks": ["peaks", RECORDING, "-s", SCHEDULE, "-o"],
    "plot": ["peaks", RECORDING, "-s", SCHEDULE, "-q", "--plot"],
    "simulate": ["simulate", SCHEDULE, "-c", TRUTH, "--unit", "kpa", "-o"],
}


def drained(path: Path, into: list[bytes]) -> threading.Thread:
    """Thread that reads a FIFO to its end."""
    thread = threading.Thread(target=lambda: into.append(path.read_bytes()))
    thread.start()
    return thread


@pytest.fixture(params=WRITERS)
def writer(request) -> list[str]:
    """Arguments of a command that writes a file, without the file."""
    return WRITERS[request.param]


@pytest.mark.parametrize("force", [[], ["--force"]], ids=["plain", "force"])
def test_a_command_writes_into_a_fifo(writer, force, tmp_path, capsys):
    fifo, received = tmp_path / "out.png", []
    os.mkfifo(fifo)
    reader = drained(fifo, received)
    # Whatever happens, the reader must see an end.
    keeper = os.open(fifo, os.O_RDWR)
    try:
        assert main([*writer, str(fifo), *force]) == 0, capsys.readouterr().err
        assert fifo.is_fifo()
    finally:
        os.close(keeper)
        reader.join(5)
    assert len(received[0]) > 100
    assert os.listdir(tmp_path) == ["out.png"]


def test_a_command_writes_through_a_link(writer, tmp_path):
    place = tmp_path / "place"
    place.mkdir()
    (place / "real.png").write_text("old")
    link = tmp_path / "link.png"
    link.symlink_to("place/real.png")
    assert main([*writer, str(link)]) == 2  # there is something already
    assert main([*writer, str(link), "--force"]) == 0
    assert link.is_symlink()
    assert (place / "real.png").stat().st_size > 100


def test_devices_and_descriptors_are_written_into():
    """Not tried with a command: broken, it would take the device from everybody."""
    assert is_stream("/dev/null")
    assert is_stream("/dev/stdout")
    assert not is_stream(TRUTH)
    assert not is_stream(EXAMPLE)
    assert not is_stream("/dev/shm/none")


def test_a_dangling_link_leads_to_a_new_file(tmp_path):
    link = tmp_path / "link"
    link.symlink_to("new")
    with atomic_path(link) as temporary:
        temporary.write_text("text")
    assert (tmp_path / "new").read_text() == "text"
    assert link.is_symlink()


def test_what_a_descriptor_points_to_is_appended_to(tmp_path):
    """As a shell's `>> log`; replaced, the log would lose what comes after."""
    log = tmp_path / "log"
    log.write_text("first\n")
    with log.open("a") as file:
        with atomic_path(f"/dev/fd/{file.fileno()}") as temporary:
            temporary.write_text("second\n")
        file.write("third\n")
    assert "third" in log.read_text()
