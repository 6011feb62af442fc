"""A batch: one row per item, nothing lost, nothing computed twice, nothing mixed up."""

import json
import re
import shutil
import sys

import numpy as np
import pandas as pd
import pytest

from pushfit.batch import identify_chunk as work
from pushfit.batch.folders import folder_name
from pushfit.batch.items import Planner
from pushfit.batch.outputs import guarded
from pushfit.batch.run import identify_batch
from pushfit.batch.store import open_store
from pushfit.batch.workers import Workers
from pushfit.config import GraspConfig
from pushfit.data.text.files import sha256_of
from pushfit.errors import ConfigError, DataError
from pushfit.fit.programs.folder import PROGRAMS
from pushfit.mechanics.registry import mechanics_named
from tests.batch import fake
from tests.batch.makers import HEADER, outputs, read_csv, table_text, write_tables


@pytest.fixture
def runs(tmp_path, monkeypatch):
    """A working folder with three tables in `runs`."""
    monkeypatch.chdir(tmp_path)
    return write_tables(tmp_path / "runs", "a", "b", "c")


def run(*inputs, out="out", **options):
    return identify_batch(inputs or ["runs"], out, identify=fake.identify, **options)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *[("n", 0), ("n", -1), ("n", 1.5), ("n", "2"), ("chunk", 0), ("chunk", 1.5)],
        *[("time_limit", 0.0), ("time_limit", -1.0), ("time_limit", "60")],
    ],
)
@pytest.mark.repeated
def test_workers_that_can_do_nothing_are_refused(key, value):
    told = re.escape(f"workers: {key} = {value!r}: state a ")
    with pytest.raises(ConfigError, match=told):
        Workers(**{key: value})


@pytest.mark.repeated
@pytest.mark.parametrize("given", [4, 0, "2", True])
def test_a_mere_number_of_workers_is_refused_with_what_to_write(given, runs, log):
    told = re.escape(f"identify_batch: workers = {given!r}: must be a Workers or None")
    with pytest.raises(ConfigError, match=rf"{told}.*pushfit.Workers\(n=4\)"):
        run(workers=given)
    assert not (runs.parent / "out").exists()


@pytest.mark.repeated
@pytest.mark.parametrize("name", ["config", "profile", "schedule"])
@pytest.mark.parametrize(
    ("given", "what"),
    [({"push": {"length_mm": 5}}, "a dict"), (GraspConfig(), "a GraspConfig"), (3, 3)],
)
def test_what_a_batch_reads_from_a_file_is_the_name_of_one(
    name, given, what, runs, log
):
    told = f"identify_batch: {name} = {what}: must be a str or a path or None; .* file"
    with pytest.raises(ConfigError, match=told):
        run(**{name: given})
    assert not (runs.parent / "out").exists()


def test_every_item_has_one_row_sorted_by_name(runs):
    found = run("runs/c.csv", "runs/a.csv", "runs/b.csv")
    rows = read_csv(runs.parent / "out" / "results.csv")
    assert [row["item"] for row in rows] == ["runs/a.csv", "runs/b.csv", "runs/c.csv"]
    assert len({row["theta_c_deg"] for row in rows}) == 3
    assert (found.n_computed, found.n_kept, found.failures) == (3, 0, ())


def test_a_batch_says_that_it_begins_and_whether_it_compiles(runs, monkeypatch):
    programs = runs.parent / "programs"
    programs.mkdir()
    monkeypatch.setenv(PROGRAMS, str(programs))
    told = []
    for out in ("first", "second"):
        run("runs", out=out, progress=lambda *stage: told.append(stage))
    starts = [stage for stage, share in told if share == 0.0 and stage != "pooling"]
    assert starts == [
        "identifying (the first tables compile programs, which takes minutes)",
        "identifying",
    ]
    assert told[1][1] > 0


def test_one_input_needs_no_list(runs):
    found = identify_batch("runs/a.csv", "out", identify=fake.identify)
    assert (found.n_computed, found.failures) == (1, ())


def test_numbers_in_the_table_are_exact(runs):
    found = run()
    rows = read_csv(runs.parent / "out" / "results.csv")
    frame = pd.read_parquet(runs.parent / "out" / "results.parquet")
    for row, cells, stored in zip(
        found.rows, rows, frame.to_dict("records"), strict=True
    ):
        assert float(cells["theta_c_deg"]) == row["theta_c_deg"]
        assert stored["theta_c_deg"] == row["theta_c_deg"]
        assert cells["theta_c_low_deg"] == ""
        assert pd.isna(stored["theta_c_low_deg"])


def test_neither_order_nor_portions_change_a_byte(runs, tmp_path):
    run("runs/a.csv", "runs/b.csv", "runs/c.csv", out="one")
    run("runs/c.csv", "runs/b.csv", "runs/a.csv", out="two", workers=Workers(chunk=1))
    assert outputs(tmp_path / "one") == outputs(tmp_path / "two")


def test_a_second_run_computes_nothing(runs, log, tmp_path):
    run()
    before = outputs(tmp_path / "out")
    assert (run().n_computed, len(log())) == (0, 3)
    assert outputs(tmp_path / "out") == before


def test_only_what_changed_is_computed_again(runs, log):
    run()
    (runs / "b.csv").write_text(table_text(99))
    (runs / "a.csv").touch()
    shutil.move(runs / "c.csv", runs / "renamed.csv")
    assert run().n_computed == 1
    assert log()[3:] == ["b.csv"]


@pytest.mark.parametrize("change", [{"seed": 1}, {"engine": "sweep"}])
def test_other_options_are_another_question(change, runs):
    run()
    assert run(**change).n_computed == 3
    assert run().n_computed == 0


def test_other_settings_are_another_question(runs):
    run()
    (runs / "b.toml").write_text("[push]\nlength_mm = 3.0\n")
    found = run()
    assert found.n_computed == 1
    lengths = {row["item"]: row["push_length_mm"] for row in found.rows}
    assert lengths == {"runs/a.csv": 5.0, "runs/b.csv": 3.0, "runs/c.csv": 5.0}
    sources = [row["config"] for row in found.rows]
    assert sources == ["defaults", "runs/b.toml", "defaults"]


def test_common_settings_that_no_item_takes_are_told_of(runs):
    common = runs.parent / "common.toml"
    common.write_text("[push]\nlength_mm = 2.0\n")
    assert not run(config=common).notice
    (runs / "grasp.toml").write_text("[push]\nlength_mm = 3.0\n")
    notice = run(config=common).notice
    assert f"{common}: no item takes these settings" in notice
    assert "runs/grasp.toml" in notice


def test_a_comment_in_the_settings_is_no_change(runs):
    (runs / "grasp.toml").write_text("[push]\nlength_mm = 3.0\n")
    run()
    (runs / "grasp.toml").write_text("# the same\n[push]\nlength_mm = 3\n")
    assert run().n_computed == 0


def test_a_changed_law_of_ones_own_is_another_question(runs, tmp_path, monkeypatch):
    """A module of the name that the settings have, which a new process reads again."""
    monkeypatch.syspath_prepend(tmp_path)
    (runs / "grasp.toml").write_text('[grasp]\nmechanics = "own"\n')
    module = tmp_path / "pushfit_own.py"
    text = "from pushfit.mechanics.registry import BUILT_IN\n"
    text += 'MECHANICS = BUILT_IN["linear"]\n'
    computed = []
    for change in ("", "", "# another law\n"):
        module.write_text(text + change)
        computed.append(run().n_computed)
    assert computed == [3, 0, 3]
    mechanics_named.cache_clear()
    sys.modules.pop("pushfit_own")


def test_a_changed_message_definition_is_another_question_for_bags(runs):
    """What the numbers in a bag without definitions are, the definitions say."""
    (runs / "a.csv").write_bytes(b"\x89MCAP0\r\n")
    (runs / "grasp.toml").write_text('[recording]\ndefinitions = "src"\n')
    message = runs.parent / "src" / "sensors" / "msg" / "Hand.msg"
    message.parent.mkdir(parents=True)

    def keys() -> dict[str, str]:
        common = {"config": None, "profile": None, "schedule": None}
        planner = Planner(**common, seed=0, engine="auto")
        return {
            item.name: item.key
            for item in planner.plan(("runs/a.csv", "runs/b.csv")).items
        }

    message.write_text("float64 pressure\n")
    before = keys()
    message.write_text("float32 pressure\n")
    after = keys()
    assert before["runs/a.csv"] != after["runs/a.csv"]
    assert before["runs/b.csv"] == after["runs/b.csv"]
    message.rename(message.with_name("Finger.msg"))
    assert after["runs/a.csv"] != keys()["runs/a.csv"]


def test_a_result_that_was_lost_is_computed_again_though_its_row_is_there(runs, log):
    run()
    (runs.parent / "out" / "batch.sqlite").unlink()
    assert run().n_computed == 3


def test_equal_content_is_computed_once_and_named(runs, log):
    shutil.copy(runs / "a.csv", runs / "again.csv")
    found = run()
    assert sorted(log()) == ["a.csv", "b.csv", "c.csv"]
    again = next(row for row in found.rows if row["item"] == "runs/again.csv")
    first = next(row for row in found.rows if row["item"] == "runs/a.csv")
    assert again["duplicate_of"] == "runs/a.csv"
    assert again["theta_c_deg"] == first["theta_c_deg"]


STAGES = {"reject": "fit", "bug": "fit", "empty": "read", "sums": "read"}


def test_a_bad_item_never_harms_another(runs, tmp_path):
    run(out="good")
    write_tables(runs, "x_reject", "x_bug")
    (runs / "x_empty.csv").write_text("")
    (runs / "x_sums.csv").write_text(f"{HEADER}\n1,2\n1,2,3\n")
    found = run()
    reasons = read_csv(tmp_path / "out" / "failures.csv")
    assert {row["item"]: row["stage"] for row in reasons} == {
        f"runs/x_{name}.csv": stage for name, stage in STAGES.items()
    }
    assert [row["status"] for row in found.rows] == ["ok"] * 3 + ["failed"] * 4
    good = read_csv(tmp_path / "good" / "results.csv")
    rows = read_csv(tmp_path / "out" / "results.csv")
    assert rows[:3] == good


def test_a_failure_names_its_item_once_and_no_other(runs):
    """Of two files of the same content each has its own name beside the reason."""
    for name in ("x_sums", "y_sums"):
        (runs / f"{name}.csv").write_text(f"{HEADER}\n1,2,3\n1,2,3\n1,2\n")
    first, second = run().failures
    assert (first.item, second.item) == ("runs/x_sums.csv", "runs/y_sums.csv")
    assert first.message == second.message
    assert first.message.startswith("line 4: 2 fields")


def test_a_link_to_nothing_is_named_once(runs):
    (runs / "x_gone.csv").symlink_to("nowhere.csv")
    (failure,) = run().failures
    assert (failure.item, failure.code) == ("runs/x_gone.csv", "file_error")
    assert failure.message == "No such file or directory"


def test_a_failure_is_tried_again(runs, log):
    write_tables(runs, "x_reject")
    run()
    assert run().failures
    assert log().count("x_reject.csv") == 2
    assert log().count("b.csv") == 1


def test_wrong_settings_of_one_file_fail_that_file(runs):
    (runs / "b.toml").write_text("[push]\nlenght_mm = 3.0\n")
    found = run()
    assert [(f.item, f.stage) for f in found.failures] == [("runs/b.csv", "input")]
    assert "length_mm" in found.failures[0].message


def test_wrong_common_settings_stop_everything_at_once(runs, log):
    (runs.parent / "c.toml").write_text("[push]\nlenght_mm = 3.0\n")
    with pytest.raises(ConfigError, match="length_mm"):
        run(config="c.toml")
    assert not (runs.parent / "out").exists()


def test_the_seed_of_an_item_is_its_own(runs):
    """Each is what `pushfit sample --seed` needs to do one item again."""
    seeds = {row["item"]: row["seed"] for row in run().rows}
    assert len(set(seeds.values())) == 3
    alone = run("runs/b.csv", out="alone")
    assert alone.rows[0]["seed"] == seeds["runs/b.csv"]


def long_table(grasps: dict[str, int]) -> str:
    lines = [f"grasp,{HEADER}"]
    for name, seed in grasps.items():
        lines += [f"{name},{row}" for row in table_text(seed).splitlines()[1:]]
    return "\n".join(lines) + "\n"


def test_a_long_table_is_one_item_for_each_grasp(runs, tmp_path):
    """The same pushes in a file of their own, but for the seed, make the same row."""
    (tmp_path / "long.csv").write_text(long_table({"foam": 0, "wood": 1}))
    found = run("long.csv", out="long")
    assert [row["item"] for row in found.rows] == ["long.csv#foam", "long.csv#wood"]
    assert [row["n_pushes"] for row in found.rows] == [4, 4]


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_grasp_that_changed_is_computed_alone(suffix, runs, tmp_path):
    def write(grasps):
        (tmp_path / "long.csv").write_text(long_table(grasps))
        if suffix == "parquet":
            pd.read_csv(tmp_path / "long.csv").to_parquet(tmp_path / "long.parquet")

    write({"foam": 0, "wood": 1})
    run(f"long.{suffix}")
    write({"wood": 1, "cork": 3, "foam": 2})
    assert run(f"long.{suffix}").n_computed == 2


def test_a_wrong_cell_in_a_long_table_fails_its_grasp_alone(runs, tmp_path):
    text = long_table({"foam": 0, "wood": 1}).replace("wood,10,", "wood,200,")
    (tmp_path / "long.csv").write_text(text)
    found = run("long.csv")
    assert [row["status"] for row in found.rows] == ["ok", "failed"]
    assert "line 7" in found.failures[0].message


def test_a_row_without_a_grasp_is_refused_with_its_line(runs, tmp_path):
    (tmp_path / "long.csv").write_text(long_table({"foam": 0, "": 1}))
    assert "line 6, column grasp" in run("long.csv").failures[0].message


def test_nothing_to_do_is_said(runs, tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="no recording or table"):
        run("empty")


def test_a_folder_of_other_things_is_not_written_to(runs, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").touch()
    with pytest.raises(ConfigError, match=r"thesis\.tex"):
        run()
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("is_there", [False, True])
def test_a_link_stays_and_the_batch_is_where_it_leads(runs, tmp_path, is_there):
    if is_there:
        (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to("disk")
    run()
    assert (tmp_path / "out").is_symlink()
    assert (tmp_path / "disk" / "results.csv").is_file()


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_an_interruption_loses_only_the_chunk_in_flight(stop, runs, log, tmp_path):
    run(out="whole")
    done = []

    def interrupted(tables, config, *, seeds, engine):
        if len(done) == 2:
            raise stop
        done.append(1)
        return fake.identify(tables, config, seeds=seeds, engine=engine)

    with pytest.raises(stop):
        identify_batch(["runs"], "out", workers=Workers(chunk=1), identify=interrupted)
    assert not (tmp_path / "out" / "results.csv").exists()
    assert run().n_computed == 1
    assert len(log()) == 6
    assert outputs(tmp_path / "out") == outputs(tmp_path / "whole")


def test_what_a_killed_run_left_half_written_is_swept(runs, tmp_path):
    run()
    (tmp_path / "out" / ".results.csv.abc.tmp").touch()
    (tmp_path / "out" / "items" / ".a.12.partial").mkdir(parents=True)
    run()
    left = [p.name for p in (tmp_path / "out").rglob(".*")]
    assert left == []


FORMULAS = ["=HYPERLINK(1)", "+1", "-1", "@SUM(A1)", "\tx", "\rx"]


@pytest.mark.parametrize("text", FORMULAS)
def test_text_that_a_spreadsheet_would_run_is_guarded(text):
    assert str(guarded(text)).startswith("'")


def test_numbers_are_not_guarded():
    assert guarded(-1.5) == -1.5
    assert guarded("-") == "'-"


def test_hostile_names_stay_in_the_folder_and_on_their_line(runs, tmp_path):
    names = ["=cmd|calc", "a\nb", "\x1b[31mred", "CON", "-rf"]
    for seed, name in enumerate(names):
        (tmp_path / f"{name}.csv").write_text(table_text(seed))
    run(*(f"{name}.csv" for name in names))
    rows = read_csv(tmp_path / "out" / "results.csv")
    assert len(rows) == len(names)
    for row in rows:
        assert row["item"].isprintable()
        assert not row["item"].startswith(("=", "-"))


@pytest.mark.parametrize("name", ["../../x", "/etc/passwd", "CON", "..", "a" * 500])
def test_the_folder_of_an_item_is_in_the_batch(name, tmp_path):
    path = tmp_path / folder_name(name)
    assert path.resolve().parent == tmp_path.resolve()
    assert folder_name(name).isascii()
    path.mkdir()


def test_names_that_differ_have_folders_that_differ():
    names = ["a b", "a_b", "A_B", "a/b"]
    assert len({folder_name(name).lower() for name in names}) == len(names)


def test_a_process_that_is_limited_needs_dask(runs, monkeypatch):
    monkeypatch.setattr("pushfit.batch.workers.find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"pip install '.\[distributed\]'"):
        run(workers=Workers(n=2))


def test_the_draws_of_an_item_are_kept_for_pooling(runs, tmp_path):
    found = run("runs/a.csv")
    expected = np.random.default_rng(found.rows[0]["seed"])
    expected.normal()
    asked = {"config": None, "profile": None, "schedule": None}
    plan = Planner(**asked, seed=0, engine="auto").plan(("runs/a.csv",))
    with open_store(tmp_path / "out") as (store, _):
        kept = store.get(plan.items[0].key)
    assert kept is not None
    np.testing.assert_array_equal(kept.draws["theta_c_deg"], expected.normal(size=5))
    assert json.loads(json.dumps(kept.values)) == kept.values


def test_folders_have_the_notes_in_the_words_of_who_reads_them(runs, monkeypatch):
    """A push that pulls back is told of in a note, which names a setting."""
    time = np.arange(0.0, 18.0, 0.01)
    level = np.random.default_rng(0).standard_normal(time.size)
    for k, height in enumerate([-200, 100, 120]):
        level += height * np.exp(-(((time - 6 * k - 3) / 0.4) ** 2))
    columns = {"time_s": time, "f_n": level, "theta_deg": 30.0, "alpha_deg": 0.0}
    pd.DataFrame(columns).to_csv(runs / "log.csv", index=False)
    seen = []

    def refuse(table, *arguments: object, **options: object) -> None:
        seen.extend(table.notes)
        raise DataError("enough", code="enough")

    monkeypatch.setattr(work, "identify_table", refuse)
    run("runs/log.csv", folders=True)
    run("runs/log.csv", out="words", folders=True, worded=str.upper)
    n = len(seen) // 2
    assert any("`signed=True`" in note for note in seen[:n])
    assert seen[n:] == [note.upper() for note in seen[:n]]


def test_the_page_leads_to_folders_of_these_results_and_to_no_others(runs, tmp_path):
    shutil.copy(runs / "a.csv", runs / "again.csv")
    run()
    asked = {"config": None, "profile": None, "schedule": None}
    plan = Planner(**asked, seed=0, engine="auto").plan(("runs/a.csv",))
    own = tmp_path / "out" / "items" / folder_name("runs/a.csv")
    own.mkdir(parents=True)
    for name in ("summary.json", "report.html"):
        (own / name).write_text(name)
    with open_store(tmp_path / "out") as (store, _):
        digest = sha256_of(own / "summary.json")
        store.save_folder(own.name, plan.items[0].key, digest)
    link, page = f"items/{own.name}/report.html", tmp_path / "out" / "report.html"
    run()
    # Its duplicate has no folder of its own.
    assert page.read_text().count(f'href="{link}"') == 2
    (runs / "grasp.toml").write_text("[push]\nlength_mm = 3.0\n")
    run()
    assert link not in page.read_text()


@pytest.mark.slow
def test_the_folder_of_an_item_is_written_once_and_mended(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_tables(tmp_path / "runs", "a", n=12)
    found = run("runs", folders=True)
    assert found.failures == ()
    summary = tmp_path / "out" / "items" / folder_name("runs/a.csv") / "summary.json"
    content = json.loads(summary.read_text())
    assert content["seed"] == found.rows[0]["seed"]
    assert content["recipe"]["table"] == "runs/a.csv"
    written = summary.stat().st_ino
    run("runs", folders=True)
    assert summary.stat().st_ino == written
    summary.write_text("{}")
    run("runs", folders=True)
    assert json.loads(summary.read_text()) == content


def test_a_table_is_no_recording_and_has_no_schedule(runs):
    (runs / "schedule.csv").write_text("push,theta_deg,alpha_deg\n1,10,90\n")
    found = run()
    assert [row["kind"] for row in found.rows] == ["table"] * 3
    for row in found.rows:
        assert (row["schedule"], row["schedule_sha256"]) == (None, None)
