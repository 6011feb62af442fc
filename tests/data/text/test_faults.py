"""Where each fault that a recording may have is tested, and the tests that are no
reader's or extractor's alone.

The numbers are those of the project's catalogue of faults: 1 to 18 are of files and
text, 19 to 33 of values. A fault is tested where the code is; the table keeps count.
"""

import ast
import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pushfit.config import GraspConfig
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.data.simulate import simulate_recording, simulate_table
from pushfit.errors import DataError
from pushfit.fit.checks.table_checks import table_warnings
from pushfit.model import Grasp, Parameters
from tests.problems import BIOTAC
from tests.tolerances import MAX_Z

TESTS = Path(__file__).parents[2]
RECORDING, REFUSALS, PRESCAN, PEAKS, SATURATION = (
    "data/recordings/test_recording",
    "data/recordings/test_refusals",
    "data/text/test_csv_reader",
    "data/peaks/test_peaks",
    "data/peaks/test_saturation",
)
# InputProblem: module of the test, then tests or cases of a table in it.
WHERE = {
    "1 missing path, folder": (
        (REFUSALS, "test_a_missing_path_names_the_nearest_one"),
        (REFUSALS, "test_a_folder_is_not_a_recording"),
        ("cli/test_inputs", "test_all_missing_inputs_are_named_before_any_work"),
    ),
    "2 empty, header only": ((REFUSALS, "empty", "blank_lines_only", "header_only"),),
    "3 no table at all": (
        (REFUSALS, "spreadsheet", "web_page", "lfs_pointer", "json", "cut_gzip"),
        (RECORDING, "gzip"),
        (REFUSALS, "test_a_small_zip_that_grows_without_end_is_refused"),
    ),
    "4 encodings": (
        (RECORDING, "utf_16_little_endian", "byte_order_mark"),
        (REFUSALS, "latin_1"),
        (REFUSALS, "utf_16_without_mark"),
    ),
    "5 zero bytes": (
        (REFUSALS, "zero_bytes_at_the_end", "zero_bytes_inside"),
        (RECORDING, "test_zero_bytes_at_the_end_are_dropped_when_asked"),
    ),
    "6 semicolons, decimal commas": (
        (RECORDING, "semicolons_and_decimal_commas"),
        (REFUSALS, "mixed_decimal_marks"),
    ),
    "7 decimal commas between commas": ((REFUSALS, "decimal_comma_between_commas"),),
    "8 trailing delimiter": (
        (RECORDING, "trailing_comma_in_all_rows"),
        (REFUSALS, "an_extra_field_that_is_not_empty"),
    ),
    "9 ragged rows": (
        (REFUSALS, "ragged_row", "test_all_problems_of_a_file_are_listed_at_once"),
    ),
    "10 cut last line": (
        (RECORDING, "test_a_cut_last_line_is_dropped_with_a_note"),
        (REFUSALS, "no_line_end_when_strict"),
    ),
    "11 doubled names": ((REFUSALS, "doubled_name", "pandas_copy_of_a_name"),),
    "12 missing column": (
        (REFUSALS, "mapped_column_is_missing", "no_unit_on_any_signal", "no_time"),
    ),
    "13 repeated header, row of units": (
        (RECORDING, "row_of_units"),
        (REFUSALS, "appended_log"),
    ),
    "14 no header": (
        (REFUSALS, "no_names"),
        ("data/text/test_dialects", "test_names_from_the_user_must_name_every_field"),
    ),
    "15 line ends": ((RECORDING, "old_mac_line_ends", "mixed_line_ends"),),
    "16 no numbers": (
        (REFUSALS, "word", "thousands", "hexadecimal", "dash", "excel_error"),
        (REFUSALS, "not_available", "truth_value"),
        (REFUSALS, "test_bad_cells_are_listed_up_to_ten_and_counted"),
    ),
    "17 file still written": (
        (REFUSALS, "test_a_file_that_changes_while_it_is_read_is_refused"),
        (REFUSALS, "test_a_bag_that_is_still_recorded_is_refused"),
    ),
    "18 too large": (
        (PRESCAN, "test_what_would_need_too_much_memory_is_refused_after_the_scan"),
        (PRESCAN, "test_columns_that_nobody_needs_cost_no_memory"),
    ),
    "19 missing samples": (
        (RECORDING, "test_gaps_stay_missing_when_split"),
        (REFUSALS, "missing_sample"),
        (RECORDING, "test_short_gaps_are_filled_on_the_straight_line"),
        (PEAKS, "test_a_gap_at_the_top_is_flagged_and_one_at_rest_is_not"),
    ),
    "20 infinite": ((REFUSALS, "infinite", "overflow", "large_exponent"),),
    "21 time": ((REFUSALS, "time_twice", "time_goes_back", "nanoseconds_as_seconds"),),
    "22 uneven steps": (
        (RECORDING, "test_irregular_sampling_is_a_note_not_an_error"),
        (PEAKS, "test_uneven_steps_do_not_shift_heights"),
    ),
    "23 wrong unit of pressure": (
        (REFUSALS, "counts_as_kilopascals", "pascals_as_kilopascals"),
    ),
    "24 wrong unit of angles": (
        (REFUSALS, "radians_as_degrees", "degrees_as_radians", "more_than_a_turn"),
    ),
    "25 saturation": (
        (SATURATION, "test_saturated_pushes_are_flagged_and_out_of_use"),
        (SATURATION, "test_a_noisy_ceiling_is_recognised"),
    ),
    "26 drift": (
        ("data/text/test_faults", "test_drift_is_taken_from_each_height"),
        ("data/text/test_faults", "test_a_push_that_drift_might_explain_is_flagged"),
    ),
    "27 missing and extra pushes": (
        (PEAKS, "test_a_missing_push_is_named_with_its_direction_and_time"),
        (PEAKS, "test_a_push_cut_by_either_end_is_flagged"),
        (PEAKS, "test_humps_within_a_push_do_not_split_it"),
        ("data/text/test_faults", "test_a_push_too_many_is_named_with_its_time"),
    ),
    "28 upside down": (
        (PEAKS, "test_an_upside_down_signal_is_refused_with_the_way_out"),
    ),
    "29 constant": ((PEAKS, "test_a_signal_without_pushes_is_refused"),),
    "30 too few pushes": (
        ("data/text/test_faults", "test_too_few_elevations_are_told_with_the_way_out"),
        ("fit/profiles/test_profiles", "test_one_elevation_determines_no_angle"),
        ("fit/identify/test_identify", "test_one_azimuth_gives_no_direction"),
    ),
    "31 outlying push": (
        ("fit/checks/test_model_checking", "test_an_outlying_push_is_named"),
    ),
    "32 the same recording twice": (
        ("data/tables/test_merge", "test_a_recording_named_twice_is_refused"),
        ("cli/test_inputs", "test_a_recording_named_twice_is_not_counted_twice"),
    ),
    "33 labels": (
        (RECORDING, "text_that_is_not_needed"),
        (PRESCAN, "test_a_table_keeps_names_text_and_line_numbers"),
        (PRESCAN, "test_a_long_text_is_kept_whole_and_shown_short"),
    ),
}


@cache
def named_in(module: str) -> frozenset[str]:
    """Functions of a test module, and the keys of its tables."""
    tree = ast.parse((TESTS / f"{module}.py").read_text(encoding="utf-8"))
    names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    tables = [
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict)
    ]
    keys = [key for table in tables for key in table.keys]
    names |= {key.value for key in keys if isinstance(key, ast.Constant)}
    return frozenset(names)


def test_every_fault_has_its_test():
    assert [int(fault.split()[0]) for fault in WHERE] == list(range(1, 34))
    missing = [
        (fault, name)
        for fault, places in WHERE.items()
        for module, *names in places
        for name in names
        if name not in named_in(module)
    ]
    assert missing == []


PARAMS = Parameters(K_sn=800.0, K_dn=1500.0, K_st=400.0, C_rr=0.3, C_d=0.3, L=0.04)
GRASP = Grasp(push_length=5e-3, gain=200.0)
PLAN = PushSchedule.planned(np.radians([20.0, 40, 60]), 0.0, repeats=3)


def drifting(drift: float):
    """Pushes on a rest that moves, in counts per second."""
    session = dataclasses.replace(BIOTAC, drift=drift)
    return simulate_recording(
        PARAMS, GRASP, PLAN, session=session, rng=np.random.default_rng(2)
    )


def test_drift_is_taken_from_each_height():
    """Twelve counts for each push of 350 to 600 counts, two percent or more."""
    made = drifting(4.0)
    table = extract_peaks(made.recording, PLAN)
    assert table.is_used.all()
    error = table.heights("height") - np.asarray(made.truth.height)
    # Nine residuals exceed four standard deviations by chance once in 1800 seeds.
    assert np.abs(error / table.sd("height")).max() < MAX_Z


def test_a_push_that_drift_might_explain_is_flagged():
    """The rest moves by more than 15 % of the lowest heights, 184 counts."""
    table = extract_peaks(drifting(25.0).recording, PLAN)
    assert ["drift" in words for words in table.flags] == [True] * 3 + [False] * 6
    assert table.is_used.tolist() == [False] * 3 + [True] * 6
    assert "drift: push 1, 2, 3" in table.notes


def test_a_push_too_many_is_named_with_its_time():
    made = drifting(0.0)
    time = made.recording.time
    width = 0.15
    middle = (made.t_peak[3] + made.t_peak[4]) / 2
    extra = 300.0 * np.exp(-(((time - middle) / width) ** 2))
    pressure = made.recording.channels["pressure"] + extra
    recording = dataclasses.replace(made.recording, channels={"pressure": pressure})
    table = extract_peaks(recording, PLAN)
    assert table.n_pushes == 9
    (caution,) = [c for c in table.cautions if "is no planned push" in c]
    assert "left out; say so by `exclude=" in caution
    assert abs(float(caution.split(" at ")[1].split()[0]) - middle) < width


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n_samples", [2_000, 20_000, 100_000])
def test_noise_alone_has_no_pushes(n_samples, seed):
    noise = np.random.default_rng(seed).standard_normal(n_samples)
    recording = Recording(
        time=np.arange(n_samples) / 100, channels={"p": noise}, units={"p": "kpa"}
    )
    with pytest.raises(DataError, match="no hump stands out of the noise"):
        extract_peaks(recording, PLAN)


@pytest.mark.parametrize("n_elevations", [1, 2])
def test_too_few_elevations_are_told_with_the_way_out(n_elevations):
    theta = np.radians([30.0, 60.0][:n_elevations])
    table = simulate_table(
        PARAMS,
        GRASP,
        theta=theta,
        alpha=0.0,
        repeats=3,
        noise=1.0,
        rng=np.random.default_rng(0),
        unit="counts",
    )
    warnings = {
        warning.code: warning.text for warning in table_warnings(table, GraspConfig())
    }
    assert f"only {n_elevations} distinct elevation" in warnings["few_elevations"]
    assert "needs several on both sides" in warnings["few_elevations"]
