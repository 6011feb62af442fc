"""Whatever a command writes goes through links and into devices, and replaces neither.

The special file is made here: a FIFO stands for every device, since a test cannot make
one of those without being root.
"""

import errno
import os
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure
from typer.main import get_command

from pushfit.atomic import atomic_path, is_stream
from pushfit.cli.app import app, main

EXAMPLE = Path(__file__).parents[1] / "examples" / "foam_box"
RECORDING, SCHEDULE = (
    str(EXAMPLE / name) for name in ("alpha_sweep.csv", "alpha_schedule.csv")
)
TRUTH, CONFIG = (str(EXAMPLE / f"{name}.toml") for name in ("truth", "grasp"))
# Every command that writes single files, up to the name of the file, which follows.
WRITERS = {
    "coverage": ["coverage", SCHEDULE, "-c", CONFIG, "--plot"],
    "diff": ["diff", str(EXAMPLE), str(EXAMPLE), "--plot"],
    "next": ["next", "-c", CONFIG, "--unit", "kpa", "--plot"],
    "report": ["report", str(EXAMPLE), "-o"],
    "init": ["init"],
    "look": ["look", RECORDING, "--export"],
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
def writer(request, monkeypatch) -> list[str]:
    """Arguments of a command, up to the file; nothing is fitted."""

    def stand_in(value: object, *names: str) -> None:
        for name in names:
            monkeypatch.setattr(f"pushfit.{name}", lambda *_, **__: value)

    found, report = SimpleNamespace(differences=(1,)), "report.text"
    stand_in(found, "report.store.read.read_result", "cli.commands.analysis.load_table")
    stand_in(
        found, "fit.coverage.coverage_study", f"{report}.difference.compare_results"
    )
    stand_in((), "explore.explorer.Explorer.ask")
    stand_in(Figure(), "report.figures.diagnostics.study_figure")
    stand_in(Figure(), "report.figures.exploration.exploration_picture")
    stand_in(Figure(), "report.figures.posterior.forest_figure")
    stand_in("x" * 200, "report.html.result.render_html", "cli.look.page.static_page")
    for text in ("coverage.study", "difference.difference", "exploration.next"):
        stand_in("", f"{report}.{text}_text")
    return WRITERS[request.param]


def test_these_are_all_commands_that_write_single_files():
    """Others write folders, and one name is a former one; `peaks` has two outputs."""
    commands = get_command(app).commands
    writing = {
        name
        for name, command in commands.items()
        for parameter in command.params
        if {"--plot", "--output", "--export"} & set(parameter.opts)
    }
    known = {words[0] for words in WRITERS.values()}
    assert writing | {"init"} == known | {"calibrate"}


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


def test_what_a_full_disk_refuses_is_named(writer, tmp_path, monkeypatch, capsys):
    def refuse(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", refuse)
    out = tmp_path / "out.png"
    assert main([*writer, str(out)]) == 2
    said = capsys.readouterr().err
    assert f"error: {out}: No space left on device; nothing was written" in said
    assert not os.listdir(tmp_path)


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
