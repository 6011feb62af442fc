"""Tables of peak heights: what is read, what is refused and with which words."""

import os

import numpy as np
import pandas as pd
import pytest

from pushfit.atomic import atomic_path
from pushfit.cli.app import main
from pushfit.data.check import file_kind
from pushfit.data.tables.grasps import is_long_table, read_tables
from pushfit.data.tables.peak_table import PeakTable, read_table, write_table
from pushfit.data.text.files import Source
from pushfit.errors import ConfigError, DataError
from tests.tolerances import EXACT

GOOD = "theta_deg,alpha_deg,height_n\n15,90,1.0\n30,90,2.0\n15,90,1.2\n"


def written(tmp_path, text, name="peaks.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def rejected(tmp_path, text):
    with pytest.raises(DataError) as caught:
        read_table(written(tmp_path, text))
    return caught.value


def test_pushes_are_numbered_in_order_and_repeats_within_a_direction(tmp_path):
    table = read_table(written(tmp_path, GOOD))
    assert table.frame["push"].tolist() == [1, 2, 3]
    assert table.frame["repeat"].tolist() == [1, 1, 2]
    assert table.groups.tolist() == [0, 1, 0]


TWO = "Grasp," + GOOD.replace("\n1", "\na,1").replace("\n3", "\nb,3")


def test_pushes_of_several_grasps_are_not_read_as_those_of_one(tmp_path):
    error = rejected(tmp_path, TWO)
    assert error.code == "several_grasps"
    assert "a (lines 2, 4), b (line 3)" in str(error)
    assert "pushfit batch" in str(error)


def test_a_table_may_name_its_one_grasp(tmp_path):
    assert read_table(written(tmp_path, TWO.replace("b", "a"))).n_pushes == 3


def test_grasps_in_one_file_are_read_apart(tmp_path):
    tables = read_tables(written(tmp_path, TWO))
    heights = {name: table.heights("height").tolist() for name, table in tables.items()}
    assert heights == {"a": [1.0, 1.2], "b": [2.0]}


def test_grasps_are_found_below_what_stands_before_the_columns(tmp_path):
    path = written(tmp_path, "unit: N\n" + TWO)
    assert is_long_table(path)
    assert list(read_tables(path)) == ["a", "b"]


def test_grasps_of_a_parquet_file_are_read_apart_whatever_the_case(tmp_path):
    pytest.importorskip("pyarrow")
    path = tmp_path / "peaks.parquet"
    pd.read_csv(written(tmp_path, TWO)).to_parquet(path)
    assert list(read_tables(path)) == ["a", "b"]


def test_a_column_of_grasps_that_names_none_is_as_good_as_none(tmp_path):
    path = written(tmp_path, TWO.replace("\na", "\n").replace("\nb", "\n"))
    assert not is_long_table(path)
    (table,) = read_tables(path).values()
    assert table.n_pushes == read_table(path).n_pushes == 3


def test_rows_without_a_grasp_among_others_are_to_be_given_one(tmp_path):
    error = rejected(tmp_path, TWO.replace("\nb", "\n"))
    assert "none (line 3); give every row its grasp" in str(error)
    assert "batch" not in str(error)


def test_angles_are_radians_inside(tmp_path):
    table = read_table(written(tmp_path, GOOD))
    assert table.theta.tolist() == pytest.approx(
        [np.pi / 12, np.pi / 6, np.pi / 12], rel=EXACT
    )


def test_millinewtons_and_pascals_come_in_canonical_units(tmp_path):
    newton = read_table(written(tmp_path, GOOD.replace("height_n", "height_mN")))
    assert newton.unit == "n"
    assert newton.heights("height").tolist() == pytest.approx(
        [1e-3, 2e-3, 1.2e-3], rel=EXACT
    )


def test_pooled_sd_is_the_scatter_about_each_direction(tmp_path):
    """1.0 and 1.2 about 1.1, one degree of freedom: s² = 2 * 0.1²."""
    sd, dof = read_table(written(tmp_path, GOOD)).pooled_sd("height")
    assert dof == 1
    assert sd == pytest.approx(0.1 * np.sqrt(2), rel=EXACT)


def test_pooled_sd_is_unknown_without_repeats():
    table = PeakTable.from_arrays(
        theta=np.array([0.1, 0.2]),
        alpha=np.zeros(2),
        heights={"height": np.array([1.0, 2.0])},
        unit="n",
    )
    sd, dof = table.pooled_sd("height")
    assert np.isnan(sd)
    assert dof == 0


@pytest.mark.parametrize(
    ("theta", "sd", "named"),
    [
        ([20.0, 40.0], {}, r"np\.radians"),
        ([0.1, 0.2], {"height_n": np.ones(2)}, "of height_n are given"),
    ],
)
def test_arrays_that_are_meant_otherwise_are_refused(theta, sd, named):
    """Degrees, and a noise that would be lost."""
    with pytest.raises(DataError, match=named):
        PeakTable.from_arrays(
            theta=np.array(theta),
            alpha=np.zeros(2),
            heights={"height": np.array([1.0, 2.0])},
            sd=sd,
            unit="n",
        )


def test_arrays_of_a_table_stay_those_of_its_frame():
    table = PeakTable.from_arrays(
        theta=np.zeros(3), alpha=np.zeros(3), heights={"height": np.ones(3)}, unit="n"
    )
    for array in (table.theta, table.alpha, table.is_used, table.groups):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.repeated
@pytest.mark.parametrize("heights", [np.ones(3), np.ones((2, 1))])
def test_arrays_of_several_shapes_are_refused_by_name(heights):
    with pytest.raises(DataError, match=r"height_n \(.*one number for each push"):
        PeakTable.from_arrays(
            theta=np.array([0.1, 0.2]),
            alpha=np.zeros(2),
            heights={"height": heights},
            unit="n",
        )


def test_a_blank_row_is_told_to_be_one(tmp_path):
    text = "push,theta_deg,alpha_deg,height_n\n1,15,90,1\n,,,\n"
    with pytest.raises(DataError, match=r"line 3, column push: is empty; .* blank row"):
        read_table(written(tmp_path, text))


@pytest.mark.parametrize("flag", ["saturated", "clipped", "gap", "lost_contact"])
def test_flagged_heights_are_not_used(tmp_path, flag):
    text = f"theta_deg,alpha_deg,height_n,flags\n15,90,1,\n30,90,2,outlier;{flag}\n"
    assert read_table(written(tmp_path, text)).is_used.tolist() == [True, False]


def test_an_outlier_is_an_opinion_and_stays_in_use(tmp_path):
    text = "theta_deg,alpha_deg,height_n,flags\n15,90,1,outlier\n"
    assert read_table(written(tmp_path, text)).is_used.tolist() == [True]


def test_unknown_columns_are_left_out_with_a_note(tmp_path):
    text = GOOD.replace("height_n\n", "height_n,site\n").replace(".0\n", ".0,7\n")
    table = read_table(written(tmp_path, text.replace("1.2\n", "1.2,7\n")))
    assert "site" not in table.frame
    assert any("site" in note for note in table.notes)


@pytest.mark.parametrize(
    ("header", "found", "meant"),
    [
        ("theta,alpha_deg,height_n", "theta", "theta_deg or theta_rad"),
        ("theta_deg,alpha_deg,height", "height", "height_n, height_mn"),
        (
            "theta_deg,alpha_deg,height_kN",
            "height_kN",
            "height_n, height_un or height_mn?",
        ),
        (
            "theta_deg,alpha_deg,height_kpas",
            "height_kpas",
            "height_kpa, height_pa or height_au?",
        ),
        ("theta_deg,alpha_deg,heigth_n", "heigth_n", "height_n?"),
        ("thetta_deg,alpha_deg,height_n", "thetta_deg", "theta_deg?"),
    ],
)
def test_near_misses_are_asked_about(tmp_path, header, found, meant):
    error = rejected(tmp_path, GOOD.replace("theta_deg,alpha_deg,height_n", header))
    assert error.code == "near_miss_column"
    assert f"column {found}" in str(error)
    assert f"did you mean {meant}" in str(error)


@pytest.mark.parametrize(
    "given", ["height_sd_normal_n", "height_std_normal_n", "sd_height_normal_n"]
)
def test_a_standard_deviation_of_a_component_is_asked_about(tmp_path, given, capsys):
    columns = f"theta_deg,alpha_deg,height_normal_n,height_tangential_n,{given}"
    path = written(tmp_path, f"{columns}\n15,90,1.0,2.0,0.1\n30,90,2.0,1.0,0.1\n")
    assert main(["fit", str(path)]) == 3
    said = capsys.readouterr().err
    assert f"column {given}: is not known here; did you mean height_normal_sd_n" in said


LONG_WITH_BLANK = "grasp,theta_deg,alpha_deg,height_n\na,15,90,1.0\n,30,90,2.0\n"
BAD_CELLS = [
    ("30,90,2.0", "97,90,2.0", "theta_range", "theta_deg", "97"),
    ("30,90,2.0", "30,400,2.0", "alpha_range", "alpha_deg", "400"),
    ("30,90,2.0", "3x,90,2.0", "not_a_number", "theta_deg", "3x"),
    ("30,90,2.0", "30,90,inf", "not_finite", "height_n", "inf"),
    ("30,90,2.0", "30,90,", "missing_value", "height_n", "nan"),
]


@pytest.mark.parametrize(("old", "new", "code", "column", "value"), BAD_CELLS)
def test_a_bad_cell_is_named_by_line_column_and_value(
    tmp_path, old, new, code, column, value
):
    error = rejected(tmp_path, GOOD.replace(old, new))
    assert error.code == code
    assert f"line 3, column {column}: " in str(error)
    assert value in str(error)
    assert error.problems[0].line == 3


@pytest.mark.parametrize(
    ("name", "place", "line"),
    [("long.csv", "line 3", 3), ("long.parquet", "row 2", None)],
)
def test_a_push_that_names_no_grasp_is_named_by_line_and_column(
    tmp_path, name, place, line
):
    path = written(tmp_path, LONG_WITH_BLANK, "long.csv")
    if name.endswith("parquet"):
        pd.read_csv(path).to_parquet(path := tmp_path / name)
    with pytest.raises(DataError, match=f"{place}, column grasp: is empty") as caught:
        read_tables(path)
    (found,) = caught.value.problems
    assert (found.code, found.line, found.column) == ("no_grasp", line, "grasp")


def test_a_bad_cell_of_a_long_table_is_named_by_its_row_in_the_file(tmp_path):
    pytest.importorskip("pyarrow")
    frame = pd.read_csv(written(tmp_path, TWO))
    frame.loc[frame.index[-1], "theta_deg"] = 200.0
    frame.to_parquet(path := tmp_path / "long.parquet")
    with pytest.raises(DataError, match=r"row 3, column theta_deg: 200 is outside"):
        read_tables(path)


def test_columns_that_are_not_used_may_hold_anything(tmp_path):
    """Notes of the operator, numbers with a word between them, empty cells."""
    lines = GOOD.splitlines()
    cells = ("operator,temperature_c", "Anna,21.5", ",not read", "Bob: ok,")
    text = "\n".join(map(",".join, zip(lines, cells, strict=True))) + "\n"
    table = read_table(written(tmp_path, text))
    assert "columns not used: operator, temperature_c" in table.notes
    plain = read_table(written(tmp_path, GOOD, "plain.csv"))
    pd.testing.assert_frame_equal(table.frame, plain.frame)


def test_all_bad_cells_are_reported_at_once(tmp_path):
    text = GOOD.replace("30,90", "97,90").replace("15,90,1.2", "-98,90,1.2")
    error = rejected(tmp_path, text)
    assert [problem.line for problem in error.problems] == [3, 4]
    assert "(and 1 more)" in str(error)


@pytest.mark.parametrize("value", ["0", "-0.1"])
def test_a_standard_deviation_must_be_positive(tmp_path, value):
    text = f"theta_deg,alpha_deg,height_n,height_sd_n\n15,90,1,{value}\n"
    error = rejected(tmp_path, text)
    assert error.code == "sd_range"
    assert "give a number above 0" in str(error)


def test_azimuths_in_radians_are_named_by_their_column(tmp_path):
    text = "theta_deg,alpha_deg,height_n\n" + "".join(
        f"15,{alpha},1\n" for alpha in ("0.52", "1.05", "1.57")
    )
    error = rejected(tmp_path, text)
    assert "column alpha_deg: 3 azimuths from 0.52 to 1.57 degrees look" in str(error)


def test_radians_under_a_degree_suffix_are_refused(tmp_path):
    text = "theta_deg,alpha_deg,height_n\n0.26,1.57,1\n1.05,1.57,2\n"
    error = rejected(tmp_path, text)
    assert error.code == "implausible_angles"
    assert "name columns of radians theta_rad and alpha_rad" in str(error)
    renamed = text.replace("_deg", "_rad")
    table = read_table(written(tmp_path, renamed))
    np.testing.assert_array_equal(table.theta, [0.26, 1.05])


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        ("height_n\n", "no_rows", "0 data rows"),
        ("height_n,height_normal_kpa\n15,90,1,1\n", "mixed_units", "convert them"),
        ("height_n,height_N\n15,90,1,1\n", "duplicate_column", ""),
        ("height_n,push\n15,90,1,1\n30,90,1,1\n", "duplicate_push", ""),
        ("height_n,flags\n15,90,1,saturatd\n", "unknown_flag", "saturated"),
        (
            "height_n,definition\n15,90,1,top\n",
            "unknown_definition",
            "write one of them",
        ),
    ],
)
def test_a_table_that_breaks_a_rule_is_refused_by_its_name(tmp_path, text, code, words):
    error = rejected(tmp_path, f"theta_deg,alpha_deg,{text}")
    assert error.code == code
    assert words in str(error)


@pytest.fixture
def full_table():
    rng = np.random.default_rng(1)
    n = 12
    return PeakTable.from_frame(
        pd.DataFrame(
            {
                "theta_deg": rng.uniform(-90, 90, n),
                "alpha_deg": rng.uniform(-180, 180, n),
                "height_kpa": rng.normal(size=n),
                "height_sd_kpa": rng.uniform(0.1, 1, n),
                "baseline_kpa": rng.normal(size=n),
                "t_peak_s": np.where(np.arange(n) == 3, np.nan, np.arange(n) / 3),
                "flags": ["saturated;gap", *[""] * (n - 1)],
            }
        ),
        sources=(Source(path="a.csv", sha256="0" * 64, dialect="native csv"),),
        notes=("a note",),
    )


def test_angles_that_came_in_degrees_are_written_as_they_came(tmp_path):
    theta_deg = np.arange(-60.0, 61.0, 0.1).round(1)
    table = PeakTable.from_arrays(
        theta=np.radians(theta_deg),
        alpha=np.radians(theta_deg + 90.0),
        heights={"height": np.ones(theta_deg.size)},
        unit="n",
    )
    write_table(table, tmp_path / "peaks.csv")
    first = (tmp_path / "peaks.csv").read_text().splitlines()[1]
    assert first.startswith("1,-60.0,30.0,")
    again = read_table(tmp_path / "peaks.csv")
    np.testing.assert_array_equal(again.frame["theta_deg"], theta_deg)


@pytest.mark.parametrize("name", ["peaks.csv", "peaks.parquet"])
def test_a_table_in_a_folder_that_is_not_there_says_what_to_create(
    full_table, tmp_path, name
):
    with pytest.raises(ConfigError, match="missing does not exist; create it"):
        write_table(full_table, tmp_path / "missing" / name)


@pytest.mark.parametrize("name", ["peaks.csv", "peaks.parquet", "peaks.pq"])
def test_rows_survive_a_round_trip_bit_by_bit(tmp_path, full_table, name):
    write_table(full_table, tmp_path / name)
    assert file_kind(tmp_path / name) == "table"
    again = read_table(tmp_path / name)
    pd.testing.assert_frame_equal(again.frame, full_table.frame, check_exact=True)
    assert again.unit == "kpa"


def test_parquet_keeps_sources_and_notes(tmp_path, full_table):
    write_table(full_table, tmp_path / "peaks.parquet")
    again = read_table(tmp_path / "peaks.parquet")
    assert again.sources[:-1] == full_table.sources
    assert again.sources[-1].path.endswith("peaks.parquet")
    assert again.notes[: len(full_table.notes)] == full_table.notes


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path):
    path = written(tmp_path, GOOD)

    def write_half():
        with atomic_path(path) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert path.read_text() == GOOD
    assert os.listdir(tmp_path) == ["peaks.csv"]


def test_the_probing_table_reads_with_its_other_columns_left_out(real_data):
    table = read_table(real_data / "probing/probingRAL2018_T1_height_table.csv")
    assert (table.n_pushes, table.unit) == (727, "n")
    assert any("depth_mm" in note for note in table.notes)


@pytest.mark.parametrize("name", ["a.csv", "a.parquet"])
def test_a_table_takes_no_place_of_a_folder(name, full_table, tmp_path):
    (tmp_path / name).mkdir()
    with pytest.raises(ConfigError, match=f"{name}: is a folder; name a file"):
        write_table(full_table, tmp_path / name)
