"""What the command line and files of settings say about recordings."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pushfit.cli import options
from pushfit.cli.app import main
from pushfit.cli.inputs import read_settings
from pushfit.config import parse_config, read_config
from pushfit.data.load import reader_options
from pushfit.data.recordings.recording import read_recording
from pushfit.data.units import BIOTAC_PDC
from pushfit.errors import ConfigError
from tests.tolerances import ROUTES

EXAMPLE = Path(__file__).parents[2] / "examples" / "foam_box"
ALPHA_SWEEP = EXAMPLE / "alpha_sweep.csv"
COUNTS = "t,pdc\n" + "".join(f"{k / 100:.2f},{2440 + k % 3}\n" for k in range(20))
MAPPED = ["--map", "time=t", "--unit", "time=s", "--map", "pressure=pdc"]


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(COUNTS)
    return path


def facts(capsys, *arguments: object):
    code = main(["validate", "--json", *map(str, arguments)])
    document = json.loads(capsys.readouterr().out)
    assert code == 0, document
    return document["files"][0]


def test_the_command_line_names_columns_and_units(log, capsys):
    found = facts(capsys, log, *MAPPED, "--unit", "pressure=counts")
    assert found["channels"] == ["pressure_counts"]
    assert "native csv" in found["notes"][0]


def test_a_table_without_names_is_named_on_the_command_line(tmp_path, capsys):
    path = tmp_path / "bare.csv"
    path.write_text("0,1.5\n0.01,1.25\n0.02,1.5\n")
    found = facts(capsys, path, "--columns", "time_s, force_n")
    assert found["channels"] == ["force_n"]


def test_identify_reads_a_column_without_times_by_its_rate(tmp_path, capsys):
    samples = [row.split(",")[1] for row in ALPHA_SWEEP.read_text().splitlines()]
    path = tmp_path / "bare.csv"
    path.write_text("\n".join(samples))
    assert main(["identify", str(path), "--rate", "50"]) == 3
    assert "18 pushes" in capsys.readouterr().err


def test_a_dialect_that_is_not_known_is_refused_with_those_that_are(log, capsys):
    assert main(["validate", str(log), "--format", "roscsv"]) == 2
    assert "'rostopic'" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--map", "--unit"])
def test_an_option_that_is_no_pair_is_refused_with_an_example(option, log, capsys):
    assert main(["validate", str(log), option, "pdc"]) == 2
    assert f"write for example {option} pressure=" in capsys.readouterr().err


def test_a_zero_on_the_command_line_is_said(tmp_path, capsys):
    recording, settings = EXAMPLE / "theta_sweep.csv", tmp_path / "grasp.toml"
    settings.write_text("[peaks]\nbegin = 5.0\n")
    begun = read_settings(options.SettingsOptions(config=settings), begin=0.0)
    assert begun.peaks.begin == 0.0
    assert main(["peaks", str(recording), "--min-height", "0"]) == 2
    assert "min_height" in capsys.readouterr().err


PROFILE = """
[recording]
map = { time = "t", pressure = "pdc" }
unit = { time = "s", pressure = "counts" }
calibration = { pressure = { name = "biotac_pdc" } }
[sensor]
n_per_kpa = 0.2
"""


def test_a_profile_is_written_once_for_a_laboratory(log, tmp_path, capsys):
    lab = tmp_path / "lab.toml"
    lab.write_text(PROFILE)
    found = facts(capsys, log, "--profile", lab)
    assert found["channels"] == ["pressure_kpa"]
    assert any("BioTac Product Manual" in note for note in found["notes"])


def test_validate_says_where_the_pushes_of_a_plan_go(capsys):
    found = facts(capsys, EXAMPLE / "theta_schedule.csv")
    frame = pd.read_csv(EXAMPLE / "theta_schedule.csv")
    for name in ("theta_deg", "alpha_deg"):
        assert found[name] == [frame[name].min(), frame[name].max()]
    n_different = len(frame[["theta_deg", "alpha_deg"]].drop_duplicates())
    assert (found["pushes"], found["directions"]) == (len(frame), n_different)


def test_validate_says_what_should_not_be_overlooked(tmp_path, capsys):
    times = np.arange(0.0, 4000.0, 20.0)  # in ms, under a name that says s
    frame = pd.DataFrame({"time_s": times, "force_n": np.sin(times / 1e3)})
    frame.to_csv(tmp_path / "milliseconds.csv", index=False)
    assert main(["validate", str(tmp_path / "milliseconds.csv")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "warning the usual step of 20 s is that of no tactile sensor" in said


def test_grasp_toml_has_the_last_word_over_a_profile(tmp_path):
    lab, grasp = tmp_path / "lab.toml", tmp_path / "grasp.toml"
    lab.write_text(PROFILE)
    grasp.write_text(
        '[recording]\nmap = { pressure = "pac" }\n[sensor]\nn_per_kpa = 0.3\n'
    )
    merged = read_config(grasp, profile=lab)
    assert merged.recording.map == {"time": "t", "pressure": "pac"}
    assert merged.recording.unit == {"time": "s", "pressure": "counts"}
    assert merged.sensor.n_per_kpa == 0.3


def test_a_prior_in_grasp_toml_replaces_that_of_the_profile(tmp_path):
    lab, grasp = tmp_path / "lab.toml", tmp_path / "grasp.toml"
    lab.write_text("[parameters]\nL = { fixed = 0.04 }\n")
    grasp.write_text("[parameters]\nL = { lognormal = { median = 1, sd_log = 1 } }\n")
    assert read_config(grasp, profile=lab).parameters.L.fixed is None


def test_a_mistake_in_a_profile_names_the_profile(tmp_path):
    lab, grasp = tmp_path / "lab.toml", tmp_path / "grasp.toml"
    lab.write_text('[recording]\nformt = "auto"\n')
    grasp.write_text("")
    with pytest.raises(ConfigError, match=r"lab\.toml: recording\.formt.*format\?"):
        read_config(grasp, profile=lab)


def calibrated(text: str, log: Path):
    config = parse_config(PROFILE.replace('{ name = "biotac_pdc" }', text), path="c")
    return read_recording(log, **reader_options(config))


def test_a_calibration_goes_by_its_name(log):
    recording = calibrated('{ name = "biotac_pdc" }', log)
    np.testing.assert_array_equal(
        recording.channels["pressure"][:3], np.array([2440, 2441, 2442]) * 0.0365
    )
    assert BIOTAC_PDC.provenance in recording.notes[-1]


def test_a_factor_of_ones_own_needs_its_provenance(log):
    with pytest.raises(ConfigError, match="needs its provenance"):
        calibrated('{ name = "biotac_pdc", factor = 0.04 }', log)
    own = '{ name = "biotac_pdc", factor = 0.04, provenance = "bench, 3 May" }'
    recording = calibrated(own, log)
    assert recording.channels["pressure"][0] == 2440 * 0.04
    assert "(bench, 3 May)" in recording.notes[-1]


def test_a_calibration_without_a_name_needs_all_its_parts(log):
    with pytest.raises(ConfigError, match="also source_unit, target_unit, provenance"):
        calibrated("{ factor = 0.04 }", log)


def test_all_missing_inputs_are_named_before_any_work(capsys):
    sweep = str(EXAMPLE / "theta_sweep.csv")
    assert main(["identify", "nowhere.csv", sweep, "nothing.csv"]) == 2
    message = capsys.readouterr().err
    assert "nowhere.csv: no such file" in message
    assert "nothing.csv: no such file" in message


@pytest.mark.parametrize(
    "command",
    [
        ["peaks", "push.csv", "-s", "plan.csv", "-o", "push.csv"],
        ["peaks", "push.csv", "-s", "plan.csv", "-o", "./link.csv"],
        ["peaks", "push.csv", "-s", "plan.csv", "--plot", "plan.png"],
        ["fit", "result/peaks.csv", "--out", "result"],
        ["report", "result", "-o", "result/summary.json"],
    ],
    ids=" ".join,
)
def test_no_input_is_replaced_by_force(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copy(EXAMPLE / "theta_sweep.csv", "push.csv")
    shutil.copy(EXAMPLE / "theta_schedule.csv", "plan.csv")
    Path("link.csv").symlink_to("push.csv")
    Path("plan.png").symlink_to("plan.csv")
    Path("result").mkdir()
    for name in ("peaks.csv", "summary.json"):
        Path("result", name).write_text("kept")
    before = contents(tmp_path)
    assert main([*command, "--force"]) == 2
    assert "inputs are never replaced" in capsys.readouterr().err
    assert contents(tmp_path) == before


def test_no_input_becomes_a_checkpoint(tmp_path, monkeypatch, capsys):
    """It would be set aside as a broken one, also without --force."""
    monkeypatch.chdir(tmp_path)
    Path("peaks.csv").write_text("kept")
    before = contents(tmp_path)
    assert main(["fit", "peaks.csv", "--checkpoint", "./peaks.csv"]) == 2
    assert "inputs are never replaced" in capsys.readouterr().err
    assert contents(tmp_path) == before


def test_a_fifo_is_no_checkpoint(tmp_path, monkeypatch, capsys):
    """Nothing could be read back; reading would wait, and a device be renamed."""
    monkeypatch.chdir(tmp_path)
    rows = [f"{5 * i},0,{0.02 * i}" for i in range(1, 9)]
    Path("peaks.csv").write_text("\n".join(["theta_deg,alpha_deg,height_n", *rows]))
    os.mkfifo("chain")
    assert main(["fit", "peaks.csv", "--checkpoint", "chain"]) == 2
    assert "name a file for --checkpoint" in capsys.readouterr().err
    assert Path("chain").is_fifo()


def contents(folder: Path) -> dict[Path, bytes]:
    return {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_recording_named_twice_is_not_counted_twice(capsys):
    sweep, plan = str(EXAMPLE / "theta_sweep.csv"), str(EXAMPLE / "theta_schedule.csv")
    assert main(["identify", sweep, sweep, "-s", plan, "-s", plan]) == 3
    assert "has the same bytes" in capsys.readouterr().err


def test_recordings_and_schedules_are_counted_in_english(capsys):
    sweep, plan = str(EXAMPLE / "theta_sweep.csv"), str(EXAMPLE / "theta_schedule.csv")
    assert main(["identify", sweep, sweep, "-s", plan]) == 2
    assert "2 recordings and 1 schedule; give --schedule" in capsys.readouterr().err


def test_an_inverted_signal_is_turned_from_the_command_line(tmp_path, capsys):
    header, *rows = (EXAMPLE / "theta_sweep.csv").read_text().splitlines()
    at = header.split(",").index("pressure_kpa")

    def turned(row: str) -> str:
        cells = row.split(",")
        cells[at] = repr(100.0 - float(cells[at]))
        return ",".join(cells)

    path = tmp_path / "turned.csv"
    path.write_text("\n".join([header, *map(turned, rows)]) + "\n")
    plan = ["-s", str(EXAMPLE / "theta_schedule.csv")]
    assert main(["peaks", str(EXAMPLE / "theta_sweep.csv"), *plan]) == 0
    upright = capsys.readouterr().out
    assert main(["peaks", str(path), *plan, "--invert"]) == 0
    inverted = capsys.readouterr().out
    # Subtracting from 100 rounds the last digits.
    np.testing.assert_allclose(heights(inverted), heights(upright), rtol=ROUTES)


def heights(text: str) -> list[float]:
    header, *rows = text.splitlines()
    at = header.split(",").index("height_kpa")
    return [float(row.split(",")[at]) for row in rows]


def test_the_picture_is_drawn_when_pushes_are_missing(tmp_path, capsys):
    plan = tmp_path / "plan.csv"
    text = (EXAMPLE / "alpha_schedule.csv").read_text()
    plan.write_text(text + "".join(f"{k},15,170,{k - 198}\n" for k in (199, 200, 201)))
    picture = tmp_path / "peaks.png"
    sweep = str(EXAMPLE / "alpha_sweep.csv")
    assert main(["peaks", sweep, "-s", str(plan), "--plot", str(picture)]) == 3
    assert "push 199" in capsys.readouterr().err
    assert picture.stat().st_size > 10_000


def test_the_picture_is_drawn_where_directions_are_unknown(tmp_path, capsys):
    """It shows how many rows a schedule needs, and in which order."""
    plot = tmp_path / "found.svg"
    sweep = str(EXAMPLE / "alpha_sweep.csv")
    assert main(["peaks", sweep, "--plot", str(plot)]) == 0
    printed = capsys.readouterr()
    assert "18 pushes have heights and times but no directions" in printed.err
    header, *rows = printed.out.strip().splitlines()
    assert "height_kpa" in header
    assert "theta" not in header
    assert len(rows) == 18
    assert plot.read_bytes().startswith(b"<?xml")


def test_one_push_is_called_one(tmp_path, capsys):
    time = np.arange(0.0, 6.0, 0.01)
    noise = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    level = 2.0 * np.exp(-(((time - 3.0) / 0.5) ** 2)) + noise
    path, out = tmp_path / "log.csv", tmp_path / "heights.csv"
    pd.DataFrame({"time_s": time, "force_n": level}).to_csv(path, index=False)
    assert main(["peaks", str(path), "-o", str(out)]) == 0
    told = capsys.readouterr().err
    assert "so the one push has a height and times but no direction;" in told
    assert f"{out}: 1 push\n" in told


@pytest.mark.parametrize("name", ["x.jpg", "x.gif", "x.tif", "x"])
def test_a_picture_of_an_unknown_format_is_refused_with_the_known_ones(
    name, tmp_path, capsys
):
    recording = str(EXAMPLE / "alpha_sweep.csv")
    assert main(["peaks", recording, "--plot", str(tmp_path / name)]) == 2
    said = capsys.readouterr().err
    assert "bug" not in said
    assert ("no suffix" if name == "x" else f"suffix {name[1:]}") in said
    assert ".png, .svg, .pdf" in said


@pytest.mark.parametrize(
    ("command", "name", "advice"),
    [
        ("fit", "alpha_sweep.csv", "`pushfit peaks` makes one"),
        ("fit", "alpha_schedule.csv", "is a schedule"),
        ("compare", "alpha_sweep.csv", "`pushfit identify` does everything"),
        ("identify", "alpha_schedule.csv", "this as its schedule"),
        ("peaks", "alpha_schedule.csv", "this as its schedule"),
    ],
)
def test_a_file_of_another_kind_is_called_what_it_is(command, name, advice, capsys):
    assert main([command, str(EXAMPLE / name)]) == 3
    assert advice in capsys.readouterr().err


def test_a_table_is_no_recording(tmp_path, capsys):
    path = tmp_path / "peaks.csv"
    path.write_text("theta_deg,alpha_deg,height_n,t_peak_s\n10,90,1,2\n20,90,2,4\n")
    assert main(["identify", str(path)]) == 3
    assert "use `pushfit fit`" in capsys.readouterr().err


def test_a_wrong_schedule_is_not_answered_by_a_page_of_pushes(capsys):
    recording = str(EXAMPLE / "alpha_sweep.csv")
    schedule = str(EXAMPLE / "theta_schedule.csv")
    assert main(["peaks", recording, "-s", schedule]) == 3
    said = capsys.readouterr().err
    told = f"108 pushes are planned in {schedule}, 18 found: "
    assert said.startswith(f"error: {recording}: {told}")
    assert "a row for each push" not in said
    assert "and 87 more" in said
    assert len(said.replace(f"{EXAMPLE}/", "")) < 800


def test_a_schedule_that_is_too_short_is_named_with_what_to_add(tmp_path, capsys):
    plan = tmp_path / "short.csv"
    rows = (EXAMPLE / "alpha_schedule.csv").read_text().splitlines()
    plan.write_text("\n".join(rows[:-3]))
    assert main(["peaks", str(ALPHA_SWEEP), "-s", str(plan)]) == 3
    said = capsys.readouterr().err
    assert f"15 pushes are planned in {plan}, 18 found" in said
    assert "Give the schedule a row for each push that was made, or a column" in said


def test_a_counter_is_never_proposed_as_a_pressure(capsys):
    log = EXAMPLE.parent / "logs" / "rostopic.csv"
    assert main(["validate", str(log)]) == 3
    assert "--map pressure=field.bt_data0.pdc_data" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["fit", "compare", "next"])
@pytest.mark.parametrize("is_named", [False, True])
def test_settings_beside_a_table_are_not_passed_over_in_silence(
    command, is_named, tmp_path, capsys
):
    table, settings = tmp_path / "peaks.csv", tmp_path / "grasp.toml"
    table.write_text("theta_deg,alpha_deg,height_n\n10,0,none\n")
    settings.write_text("[push]\nlength_mm = 5\n")
    named = ["--config", str(settings)] if is_named else []
    assert main([command, str(table), *named]) == 3
    said = " ".join(capsys.readouterr().err.split())
    assert ("grasp.toml is not read; give --config" in said) is not is_named


@pytest.mark.parametrize(
    ("command", "settings", "rule"),
    [
        ("fit", '[noise]\nsigma = "given"', '[noise] sigma = "given", but the table'),
        ("compare", '[noise]\nsigma = "pooled"', "but no direction was pushed twice"),
        ("fit", '[noise]\nrepeats = "gain"', "no direction was pushed in two repeats"),
        ("next", "[grasp]\npreload_n = 3.0", "grasp.preload_n = 3: the heights are in"),
    ],
)
def test_settings_that_do_not_go_with_a_table_are_named_by_their_file(
    command, settings, rule, tmp_path, capsys
):
    table, config = tmp_path / "peaks.csv", tmp_path / "mine.toml"
    table.write_text("theta_deg,alpha_deg,height_kpa\n20,0,1\n50,0,3\n80,0,4\n")
    config.write_text(settings)
    assert main([command, str(table), "-c", str(config)]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"error: {config}: " in said
    assert rule in said


@pytest.mark.parametrize(
    "settings",
    [
        '[peaks]\nchannel = "force"',
        '[peaks]\nnormal = "fz"',
        "[peaks]\nbegin = 1000.0",
        '[recording]\nencoding = "utf-9"',
        '[recording]\nunit = { pressure = "furlong" }',
        '[recording]\ncalibration = { pressure = { name = "biotac_pdc" } }',
    ],
)
def test_settings_that_do_not_go_with_a_recording_name_the_recording(
    settings, tmp_path, capsys
):
    config = tmp_path / "mine.toml"
    config.write_text(settings)
    plan = ALPHA_SWEEP.with_name("alpha_schedule.csv")
    words = ["identify", str(ALPHA_SWEEP), "-s", str(plan), "-c", str(config)]
    assert main(words) in (2, 3)
    assert f"error: {ALPHA_SWEEP}: " in capsys.readouterr().err
