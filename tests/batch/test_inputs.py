"""Which files a batch takes, and what goes with each."""

import re
from pathlib import Path

import pytest

from pushfit.batch.inputs import find_inputs, schedule_for, settings_for, stem_of
from pushfit.data.text.files import SEARCHED
from pushfit.errors import ConfigError
from tests.batch.makers import write_tables


def names(found):
    return [path.rsplit("/", 1)[-1] for path in found.paths]


def test_a_folder_gives_all_tables_below_it(tmp_path):
    write_tables(tmp_path / "runs", "b", "a")
    write_tables(tmp_path / "runs" / "deep" / "er", "c")
    found = find_inputs([tmp_path / "runs"], out=tmp_path / "out")
    assert sorted(names(found)) == ["a.csv", "b.csv", "c.csv"]


def test_a_folder_gives_recordings_of_every_kind_but_logs(tmp_path):
    kinds = ["ddf", "npy", "npz", "parquet", "tsv", "txt", "csv.gz", "PQ"]
    for kind in (*kinds, "log", "md"):
        (tmp_path / f"a.{kind}").write_bytes(b"")
    found = find_inputs([tmp_path], out=tmp_path / "out")
    assert set(names(found)) == {f"a.{kind}" for kind in kinds}
    logs = find_inputs([tmp_path / "*.log"], out=tmp_path / "out")
    assert names(logs) == ["a.log"]


def test_the_page_names_every_ending_that_folders_are_searched_for():
    page = (Path(__file__).parents[2] / "docs" / "batch.md").read_text()
    inputs = page.partition("## Inputs")[2].partition("An item")[0]
    assert set(re.findall(r"`(\.\w+)`", inputs)) == SEARCHED | {".log"}


def test_the_results_are_no_inputs(tmp_path):
    write_tables(tmp_path, "a")
    write_tables(tmp_path / "out", "results")
    assert names(find_inputs([tmp_path], out=tmp_path / "out")) == ["a.csv"]


def test_settings_schedules_and_hidden_files_are_no_inputs(tmp_path):
    """Those that go with an input are not left out: own before that of the folder."""
    write_tables(tmp_path, "a", "schedule", "a.schedule", "b.schedule", ".hidden")
    for name in ("grasp.toml", "lab.toml", "other.toml", "notes.md"):
        (tmp_path / name).touch()
    common = (None, tmp_path / "lab.toml")
    found = find_inputs([tmp_path], out=tmp_path / "out", common=common)
    assert names(found) == ["a.csv"]
    assert {Path(path).name for path in found.left_out} == {
        *("schedule.csv", "b.schedule.csv", "other.toml", "notes.md")
    }


def test_a_pattern_finds_files_and_a_file_found_twice_counts_once(tmp_path):
    write_tables(tmp_path / "runs", "a1", "a2", "b1")
    pattern = f"{tmp_path}/**/a*.csv"
    found = find_inputs([pattern, tmp_path / "runs" / "a1.csv"], out=tmp_path / "o")
    assert names(found) == ["a1.csv", "a2.csv"]


def test_a_name_that_exists_is_no_pattern(tmp_path):
    write_tables(tmp_path, "run1", "run[1]")
    given = tmp_path / "run[1].csv"
    assert names(find_inputs([given], out=tmp_path / "o")) == ["run[1].csv"]
    given.unlink()
    assert names(find_inputs([given], out=tmp_path / "o")) == ["run1.csv"]


def result_folder(folder):
    """A result with its table, and no grasp of its own."""
    write_tables(folder, "peaks")
    for name in ("summary.json", "result.nc"):
        (folder / name).touch()


@pytest.mark.parametrize("given", ["", "**/*.csv", "**"])
def test_what_was_made_of_a_grasp_is_no_second_one(tmp_path, given):
    write_tables(tmp_path, "a")
    result_folder(tmp_path / "a_result")
    result_folder(tmp_path / "out" / "items" / "a")
    result_folder(tmp_path / "old" / "items" / "a")
    (tmp_path / "old" / "batch.sqlite").touch()
    write_tables(tmp_path / "old", "results")
    found = find_inputs([tmp_path / given], out=tmp_path / "out")
    assert names(found) == ["a.csv"]
    left_out = {Path(path).name for path in found.left_out}
    assert left_out == {"a_result", "old"}
    # Named itself, a result is one: its table is identified anew.
    assert names(find_inputs([tmp_path / "a_result"], out=tmp_path / "out")) == [
        "peaks.csv"
    ]


def test_links_to_folders_are_followed_but_not_in_circles(tmp_path):
    write_tables(tmp_path / "elsewhere", "linked")
    write_tables(tmp_path / "runs", "a")
    (tmp_path / "runs" / "more").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "runs" / "up").symlink_to(tmp_path / "runs")
    found = find_inputs([tmp_path / "runs"], out=tmp_path / "out")
    assert sorted(names(found)) == ["a.csv", "linked.csv"]


def test_a_broken_link_that_a_pattern_finds_stops_no_other_file(tmp_path):
    write_tables(tmp_path, "a")
    (tmp_path / "b.csv").symlink_to(tmp_path / "gone.csv")
    found = find_inputs([tmp_path / "*.csv"], out=tmp_path / "out")
    assert names(found) == ["a.csv", "b.csv"]


def test_any_suffix_can_be_named(tmp_path):
    (tmp_path / "data.log").write_text("x")
    assert names(find_inputs([tmp_path / "data.log"], out=tmp_path)) == ["data.log"]


def test_everything_that_is_missing_is_named_at_once(tmp_path):
    with pytest.raises(ConfigError) as raised:
        find_inputs([tmp_path / "no.csv", tmp_path / "*.none"], out=tmp_path / "o")
    assert "no.csv" in str(raised.value)
    assert "*.none" in str(raised.value)


def test_a_file_has_its_own_settings_before_those_of_its_folder(tmp_path):
    common = tmp_path / "common.toml"
    path = str(tmp_path / "foam.csv.gz")
    assert settings_for(path, common) == common
    (tmp_path / "grasp.toml").touch()
    assert settings_for(path, common) == tmp_path / "grasp.toml"
    (tmp_path / "foam.toml").touch()
    assert settings_for(path, common) == tmp_path / "foam.toml"


def test_a_recording_has_its_own_schedule_before_the_common_one(tmp_path):
    path = str(tmp_path / "foam.csv")
    assert schedule_for(path, None) is None
    (tmp_path / "schedule.csv").touch()
    assert schedule_for(path, None) == tmp_path / "schedule.csv"
    (tmp_path / "foam.schedule.csv").touch()
    assert schedule_for(path, None) == tmp_path / "foam.schedule.csv"


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("a.csv", "a"),
        ("a.b.csv.gz", "a.b"),
        ("run_0.db3", "run_0"),
        ("bag", "bag"),
        ("a.ddf", "a"),
    ],
)
def test_the_stem_lacks_only_what_says_how_a_file_is_stored(name, stem):
    assert stem_of(f"x.csv/{name}") == stem
