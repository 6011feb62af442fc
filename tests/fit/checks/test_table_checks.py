"""What a table says of itself before anything is fitted."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pushfit.config import GraspConfig, parse_config
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.table_checks import table_warnings
from tests.data.peaks.sweeps import simulated
from tests.fit.tables import case_table, config
from tests.problems import CASES


def codes(table: PeakTable, settings: GraspConfig | None = None) -> set[str]:
    return {w.code for w in table_warnings(table, settings or config())}


def with_heights(table: PeakTable, heights) -> PeakTable:
    return type(table).from_frame(table.frame.assign(height_n=heights))


@pytest.mark.parametrize(
    ("theta_deg", "said"),
    [
        # As a robot reaches them that was sent to 30°.
        ([29.8, 30.3, 30.0, 29.9], "1 distinct elevation, as all are within 29.8° to"),
        ([29.8, 30.3, 59.9, 60.2], "2 distinct elevations, as all are within 29.8° to"),
        ([30.0, 30.0, 60.0, 60.0], "2 distinct elevations; the critical angle"),
        (np.arange(5.0, 9.0, 0.5), None),
        ([10.0, 30.0, 50.0], None),
    ],
)
def test_elevations_that_miss_their_own_by_a_little_are_few(theta_deg, said):
    table = PeakTable.from_arrays(
        theta=np.radians(theta_deg),
        alpha=np.full(len(theta_deg), 0.5),
        heights={"height": np.linspace(1.0, 2.0, len(theta_deg))},
        unit="n",
    )
    texts = [w.text for w in table_warnings(table, config())]
    found = [text for text in texts if "distinct elevation" in text]
    assert len(found) == (said is not None)
    assert all(said in text for text in found)


def test_elevations_of_pushes_that_are_left_out_count_for_none():
    table = signed([10.0, 30.0, 50.0], [1.0, 2.0, 3.0])
    assert "few_elevations" not in codes(table)
    assert "few_elevations" in codes(table.with_flag([1], "clipped"))


@pytest.mark.parametrize(
    ("column", "key"),
    [
        ("preload_n", "grasp.preload_n"),
        (" Length_mm ", "push.length_mm"),
        ("who", None),
    ],
)
def test_a_column_that_says_what_settings_say_is_not_silently_ignored(column, key):
    table = case_table(CASES["paper"])
    named = PeakTable.from_frame(table.frame.assign(**{column: 2.0}))
    texts = [
        warning.text
        for warning in table_warnings(named, config())
        if warning.code == "column_ignored"
    ]
    assert len(texts) == (key is not None)
    assert all(f"{column} is not used: {key} in" in text for text in texts)


PRELOAD = float(CASES["preload"].grasp.preload)
PRELOADED = config(f"[grasp]\npreload_n = {PRELOAD}\n")
THREE = ("height", "height_normal", "height_tangential")


def of_three(
    *, computed: bool = True, own_noise: float = 0.0, repeats: int = 1, sd=None
) -> PeakTable:
    """|F| - F_0 of noisy components, with a preload; else a sensor of its own."""
    words = {"noise": 0.03, "repeats": repeats, "channels": THREE}
    table = case_table(CASES["preload"], **words)
    heights = {name: table.heights(name) for name in THREE}
    if computed:
        rng = np.random.default_rng(1)
        force = np.hypot(
            heights["height_normal"] + PRELOAD, heights["height_tangential"]
        )
        heights["height"] = (force - PRELOAD).round(4)
        heights["height"] += own_noise * rng.standard_normal(force.size)
    words = {} if sd is None else {"sd": dict.fromkeys(THREE, np.full(force.size, sd))}
    return PeakTable.from_arrays(
        theta=table.theta, alpha=table.alpha, heights=heights, unit="n", **words
    )


@pytest.mark.parametrize(
    ("computed", "own_noise", "said"),
    [(True, 0.0, True), (True, 0.03, False), (False, 0.0, False)],
)
@pytest.mark.parametrize("repeats", [1, 3])
def test_a_magnitude_of_the_components_beside_it_is_not_a_third_sensor(
    computed, own_noise, said, repeats
):
    table = of_three(computed=computed, own_noise=own_noise, repeats=repeats)
    assert ("counted_twice" in codes(table, PRELOADED)) is said


@pytest.mark.parametrize(
    ("off", "sd", "said"),
    [(0.002, 0.03, True), (0.012, 0.03, False), (0.002, None, False)],
)
def test_how_exact_a_computed_magnitude_is_goes_by_the_noise_that_is_stated(
    off, sd, said
):
    """Off by 2 mN, a fifteenth of the noise that is stated, or two fifths of it."""
    table = of_three(own_noise=off, sd=sd)
    assert ("counted_twice" in codes(table, PRELOADED)) is said


def test_a_magnitude_beside_a_preload_that_is_open_or_of_one_push_is_let_be():
    is_open = config('[grasp]\npreload_n = "estimate"\n')
    assert "counted_twice" not in codes(of_three(), is_open)
    one = PeakTable.from_frame(of_three(computed=False).frame[:1])
    assert "counted_twice" not in codes(one, PRELOADED)


@pytest.mark.parametrize(
    ("unit", "sensor", "known", "said"),
    [
        ("counts", "", "K_sn", "K_sn in [parameters] count in counts for newtons"),
        ("counts", "", "K_sn", "state n_per_count there"),
        ("counts", "", "C_rr", None),
        ("counts", "[sensor]\nn_per_count = 0.005\n", "K_sn", None),
        ("n", "", "K_sn", None),
    ],
)
def test_stiffness_known_in_newtons_needs_a_sensor_that_is(unit, sensor, known, said):
    table = PeakTable.from_arrays(
        theta=np.radians([10.0, 30.0, 50.0]),
        alpha=np.full(3, 0.5),
        heights={"height": np.array([1.0, 2.0, 3.0])},
        unit=unit,
    )
    settings = config(f"{sensor}[parameters.{known}]\nfixed = 0.5\n")
    texts = [
        warning.text
        for warning in table_warnings(table, settings)
        if warning.code == "sensor_stiffness"
    ]
    assert len(texts) == (said is not None)
    assert all(said in text for text in texts)


def signed(theta_deg, heights, channel="height"):
    """A table of one azimuth."""
    return PeakTable.from_arrays(
        theta=np.radians(theta_deg),
        alpha=np.full(len(theta_deg), 0.5),
        heights={channel: np.asarray(heights)},
        unit="n",
    )


@pytest.mark.parametrize("channel", ["height", "height_normal"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_heights_of_inverted_sign_are_said_with_what_turns_them(sign, channel):
    """No grasp, preloaded or not, pulls a finger that is pushed into it."""
    theta = np.linspace(10.0, 80.0, 8)
    table = signed(theta, sign * 2.5 * np.sin(np.radians(theta)) + 0.05, channel)
    said = [
        warning.text
        for warning in table_warnings(table, config())
        if warning.code == "inverted_heights"
    ]
    assert len(said) == (sign < 0)
    cure = "`invert=True`" if channel == "height" else "sign in [peaks] normal"
    assert all(text.endswith(cure) for text in said)


@pytest.mark.parametrize(
    ("stated", "may_tip"),
    [
        ("preload_n = 1.0", False),
        ("preload_n = 2.0", False),
        ("preload_n = 3.0", True),
        ("preload_counts = 300\n[sensor]\nn_per_count = 0.01", True),
        ("preload_counts = 100\n[sensor]\nn_per_count = 0.01", False),
        ('preload_n = "estimate"', False),
    ],
)
def test_an_object_that_tips_takes_no_more_than_the_preload_away(stated, may_tip):
    """Heights of -0.4 to -2.5 N, and a stated preload of less or of more."""
    theta = np.linspace(10.0, 80.0, 8)
    table = signed(theta, 0.05 - 2.5 * np.sin(np.radians(theta)))
    found = codes(table, config(f"[grasp]\n{stated}\n"))
    assert ("inverted_heights" in found) is not may_tip


@pytest.mark.parametrize(
    ("theta_deg", "heights"),
    [
        # A finger that pulls back from its preload lowers the reading.
        (np.linspace(-60.0, -10.0, 8), -2.5 * np.sin(np.linspace(1.0, 0.2, 8))),
        # By linear mechanics they are even in θ, but for noise.
        (np.linspace(-60.0, -1.0, 8), 2.5 * np.sin(np.linspace(1.0, -0.02, 8))),
        # A few in the noise about 0, or one that was mistyped.
        (np.linspace(5.0, 80.0, 8), np.linspace(-0.1, 2.0, 8)),
        (np.linspace(10.0, 80.0, 8), [0.4, 0.9, 1.2, 1.6, -1.9, 2.1, 2.3, 2.5]),
        ([30.0, 60.0], [-1.0, -2.0]),
        ([-30.0, -10.0, 30.0], [-1.0, -0.5, -0.1]),
    ],
)
def test_some_negative_heights_are_as_they_may_be(theta_deg, heights):
    assert "inverted_heights" not in codes(signed(theta_deg, heights))


def test_noise_about_nothing_is_inverted_once_in_two_thousand_tables():
    """More than 4 of 1000 tables would be so once in 5000 times, 4 of 1000 then."""
    table = signed(np.linspace(10.0, 80.0, 8), np.zeros(8))
    rng, found = np.random.default_rng(0), 0
    for _ in range(1000):
        frame = table.frame.assign(height_n=rng.standard_normal(8))
        # Its rows were checked with the first.
        found += "inverted_heights" in codes(replace(table, frame=frame))
    assert found <= 4


@pytest.mark.parametrize(
    ("other", "is_mixed"), [("apex", False), ("", False), ("plateau", True)]
)
def test_heights_of_two_definitions_in_one_fit_are_said(other, is_mixed):
    table = case_table(CASES["firm"], noise=0.02)
    definitions = ["apex"] * table.n_pushes
    definitions[3] = other
    stated = type(table).from_frame(table.frame.assign(definition=definitions))
    codes = [warning.code for warning in table_warnings(stated, config())]
    assert ("mixed_definitions" in codes) is is_mixed


@pytest.mark.parametrize("flag", ["missing", "gap"])
@pytest.mark.parametrize("use_missing", [True, False])
def test_that_missing_pushes_of_a_table_stay_out_is_said(flag, use_missing):
    settings = parse_config(
        f"[peaks]\nuse_missing = {str(use_missing).lower()}", path="grasp.toml"
    )
    table = case_table(CASES["paper"]).with_flag([3], flag)
    is_said = flag == "missing" and use_missing
    assert ("setting_ignored" in codes(table, settings)) is is_said


def test_missing_pushes_that_were_left_out_on_purpose_are_not_told_to_be_late():
    """What is measured here knows of the setting, and keeps those of `exclude` out."""
    made = simulated()
    third = made.t_peak[2]
    settings = parse_config(
        f"[peaks]\nuse_missing = true\nexclude = [[{third - 1}, {third + 1}]]",
        path="grasp.toml",
    )
    table = extract_peaks(made.recording, made.schedule, settings=settings.peaks)
    assert "missing" in table.flags[2]
    assert "setting_ignored" not in codes(table, settings)


def test_a_push_that_is_left_out_mixes_nothing():
    table = case_table(CASES["firm"], noise=0.02).with_flag([3], "clipped")
    definitions = ["apex"] * table.n_pushes
    definitions[3] = "plateau"
    stated = type(table).from_frame(table.frame.assign(definition=definitions))
    assert "mixed_definitions" not in {n.code for n in table_warnings(stated, config())}


@pytest.mark.parametrize("channel", ["height_normal", "height_tangential"])
def test_a_channel_that_reads_the_same_in_every_direction_is_named(channel):
    """Digits of a real sensor scatter; one of no pushes, or stuck, does not."""
    channels = ("height_normal", "height_tangential")
    table = case_table(CASES["firm"], noise=0.02, channels=channels)
    assert not any(w.code == "equal_heights" for w in table_warnings(table, config()))
    stuck = type(table).from_frame(table.frame.assign(**{f"{channel}_n": 1.5}))
    (said,) = [
        warning.text
        for warning in table_warnings(stuck, config())
        if warning.code == "equal_heights"
    ]
    assert said.startswith(f"{channel}_n is 1.5 in all {table.n_pushes} pushes")
    assert "heights_at_limit" not in codes(stuck)


@pytest.mark.parametrize(
    ("theta_deg", "said"),
    [
        (np.linspace(10.0, 80.0, 7), True),
        (np.linspace(10.0, 80.0, 6), False),
        (np.full(7, 30.0), False),
    ],
)
def test_a_few_equal_heights_or_those_of_one_direction_may_be_so(theta_deg, said):
    table = signed(theta_deg, np.ones(len(theta_deg)))
    assert ("equal_heights" in codes(table)) is said


@pytest.mark.parametrize(
    ("low", "high", "noise", "said"),
    [
        (10.0, 80.0, 0.05, True),
        # Of a contact that does not roll there and is as stiff both ways.
        (45.0, 80.0, 0.05, False),
        (-80.0, -45.0, 0.05, False),
        (10.0, 30.0, 0.05, False),
        (10.0, 80.0, 0.5, False),
    ],
)
def test_heights_that_are_alike_in_all_directions_are_no_proof_of_theta_c(
    low, high, noise, said
):
    """As of pushes that end at a force; a contact that rolls gives sin θ."""
    theta_deg = np.repeat(np.linspace(low, high, 8), 3)
    scatter = np.random.default_rng(1).standard_normal(24)
    for level in (2.0, -2.0):
        found = codes(signed(theta_deg, level + noise * scatter))
        assert ("alike_heights" in found) is said
        assert "equal_heights" not in found
    rolled = signed(theta_deg, 2.0 * np.sin(np.radians(theta_deg)))
    assert "alike_heights" not in codes(rolled)


@pytest.mark.parametrize(
    ("text", "is_said"),
    [
        ("", True),
        ("[grasp]\npreload_n = 0\n", False),
        ('[grasp]\npreload_kpa = "estimate"\n', False),
    ],
)
def test_a_preload_that_is_not_stated_is_an_assumption_that_is_said(text, is_said):
    table = case_table(CASES["firm"], noise=0.02)
    settings = parse_config(text, path="grasp.toml")
    assert ("preload_unknown" in codes(table, settings)) is is_said


@pytest.mark.parametrize(
    ("factor", "word"),
    [(1e3, "large"), (1e-3, "small"), (30.0, None), (1.0, None), (1 / 30, None)],
)
@pytest.mark.parametrize("case", sorted(CASES))
@pytest.mark.parametrize("rows", [[3], [0, 7]])
def test_heights_in_another_unit_are_named(case, factor, word, rows):
    table = case_table(CASES[case], noise=0.02)
    heights = table.heights("height").copy()
    heights[rows] *= factor
    said = [
        warning.text
        for warning in table_warnings(with_heights(table, heights), config())
        if warning.code == "other_unit"
    ]
    assert len(said) == (len(rows) if word else 0)
    for row, text in zip(rows, said, strict=False):
        assert text.startswith(f"push {row + 1} (θ = ")
        assert f"height_n = {heights[row]:g} is about 1000 times too {word}" in text
        assert text.endswith("correct it, or leave the push out")


@pytest.mark.parametrize(
    ("channel", "theta_deg", "heights"),
    [
        ("height_normal", [0.0, 30.0, 60.0], [0.001, 0.5, 0.9]),
        ("height_tangential", [30.0, 60.0, 90.0], [0.9, 0.5, 0.001]),
        # A finger that pulls back from a preload.
        ("height", [-30.0, -10.0, 10.0, 40.0], [-0.5, 0.001, 0.6, 0.9]),
        # Of two heights nobody knows which is wrong.
        ("height", [30.0, 60.0], [0.001, 1.0]),
    ],
)
def test_a_height_that_vanishes_by_itself_is_in_no_other_unit(
    channel, theta_deg, heights
):
    table = PeakTable.from_arrays(
        theta=np.radians(theta_deg),
        alpha=np.full(len(theta_deg), np.pi / 2),
        heights={channel: np.array(heights)},
        unit="n",
    )
    assert "other_unit" not in codes(table)


def test_a_push_against_a_preload_may_be_in_another_unit_too():
    table = signed([-60.0, -50.0, -40.0, -25.0], [-0.9, -0.8, -0.7, -0.0004])
    assert "other_unit" in codes(table)


def test_one_component_that_is_small_is_in_no_other_unit():
    channels = ("height_normal", "height_tangential")
    frame = case_table(CASES["firm"], noise=0.02, channels=channels).frame.copy()
    frame.loc[3, "height_normal_n"] /= 1e3
    assert "other_unit" not in codes(PeakTable.from_frame(frame))
    frame.loc[3, "height_tangential_n"] /= 1e3
    assert "other_unit" in codes(PeakTable.from_frame(frame))


@pytest.mark.parametrize(("limit", "is_said"), [(1.5, True), (9.0, False)])
def test_heights_that_stop_at_a_largest_one_are_said(limit, is_said):
    table = case_table(CASES["firm"], noise=0.02)
    capped = with_heights(table, np.minimum(table.heights("height"), limit))
    assert ("heights_at_limit" in codes(capped)) is is_said


@pytest.mark.parametrize("n_equal", [3, 4])
def test_three_equal_heights_at_the_top_may_be_so_by_chance(n_equal):
    table = case_table(CASES["firm"], noise=0.02)
    limit = np.sort(table.heights("height"))[-n_equal]
    capped = with_heights(table, np.minimum(table.heights("height"), limit))
    assert ("heights_at_limit" in codes(capped)) is (n_equal == 4)


@pytest.mark.parametrize(("n_top", "is_said"), [(4, False), (5, True)])
def test_a_largest_height_is_more_than_twice_as_frequent_as_any_other(n_top, is_said):
    heights = [1.0, 1.0, 2.0, 3.0, *[4.0] * n_top]
    table = signed(np.linspace(10.0, 80.0, len(heights)), heights)
    assert ("heights_at_limit" in codes(table)) is is_said


def test_whole_numbers_of_a_coarse_sensor_stop_nowhere():
    table = case_table(CASES["firm"], noise=0.02)
    rounded = with_heights(table, np.round(table.heights("height")))
    assert "heights_at_limit" not in codes(rounded)


@pytest.mark.parametrize("n_copied", [4, 17])
def test_rows_that_were_copied_are_said_and_single_ones_are_not(n_copied):
    once = case_table(CASES["firm"], noise=0.02, repeats=1)
    assert once.n_pushes == 17
    copies = once.frame[:n_copied].assign(repeat=2)
    twice = type(once).from_frame(
        pd.concat([once.frame, copies]).assign(
            push=np.arange(1, once.n_pushes + n_copied + 1)
        )
    )
    assert "copied_rows" in codes(twice)
    assert "copied_rows" not in codes(once)
    heights = twice.heights("height").copy()
    heights[-1] += 1e-3
    assert "copied_rows" not in codes(with_heights(twice, heights))


def test_two_directions_whose_repeats_agree_or_heights_that_all_do_are_no_copies():
    theta_deg = [10.0, 10.0, 40.0, 40.0, 70.0]
    assert "copied_rows" not in codes(signed(theta_deg, [1.0, 1.0, 2.0, 2.0, 3.0]))
    theta_deg, heights = [*theta_deg, 70.0], [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]
    assert "copied_rows" in codes(signed(theta_deg, heights))
    assert "copied_rows" not in codes(signed(theta_deg, np.ones(6)))
