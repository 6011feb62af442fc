"""Digits, units and the disarming of user text."""

import math

import pytest

from pushfit.report.strings import (
    format_estimate,
    format_number,
    format_range,
    join_or,
    printable,
    spread_of,
    symbol,
    unit_label,
)


@pytest.mark.parametrize(
    ("name", "letter"),
    [
        ("theta_c", "θ_c"),
        ("sigma_height", "σ"),
        ("sigma_height_normal", "σ_normal"),
        ("sigma_height_a$b", "sigma_height_a$b"),
        ("pressure", "pressure"),
    ],
)
def test_a_quantity_has_one_letter_that_of_its_channel_with_it(name, letter):
    assert symbol(name) == letter


@pytest.mark.parametrize(
    ("value", "spread", "text"),
    [
        (40.1234, 4.0, "40.1"),
        (40.1234, 16.0, "40"),
        (52341.0, 3000.0, "52300"),
        (0.30049, 0.02, "0.300"),
        (-0.0001, 1.0, "0.0"),
        (1.5e-5, 2e-6, "1.50e-05"),
        (2.34567e8, 1e7, "2.35e+08"),
        (9.96, 0.996, "10.0"),
    ],
)
def test_a_number_shows_two_digits_of_its_uncertainty(value, spread, text):
    assert format_number(value, spread=spread) == text


def test_nothing_at_all_has_one_digit():
    assert format_number(0.0) == "0"


@pytest.mark.parametrize("value", [None, math.nan])
def test_an_unknown_number_is_called_unknown_and_never_zero(value):
    assert format_number(value) == "unknown"


def test_the_near_end_of_a_skewed_interval_keeps_its_digits():
    spread = spread_of(740.0, (563.0, 1871.0))
    assert format_range(563.0, 1871.0, "", spread=spread) == "560 to 1870"


def test_an_estimate_at_the_end_of_its_interval_has_the_digits_of_the_width():
    found = format_estimate(10.0, (10.0, 43.0), "deg")
    assert found == ("10°", "10° to 43°")


@pytest.mark.parametrize("estimate", [3.0, 183.0])
def test_of_an_axis_an_interval_across_its_end_has_the_digits_of_any_other(estimate):
    """As 63° from 54° to 67° has; an axis at 183° is one at 3°."""
    assert format_estimate(63.0, (54.0, 67.0), "deg")[0] == "63.0°"
    found = format_estimate(estimate, (174.0, 187.0), "deg", is_axis=True)
    assert found == ("3.0°", "174.0° to 180° and on to 7.0°")


@pytest.mark.parametrize("spread", [0.0, -1.0, math.inf, math.nan])
def test_a_spread_that_is_none_decides_no_digits(spread):
    assert format_number(12.3456, spread=spread) == "12.3"


@pytest.mark.parametrize(
    ("lower", "upper", "unit", "text"),
    [
        (38.0, 42.0, "deg", "38.0° to 42.0°"),
        (3.0, 170.0, "deg", "3° to 170°"),
        (61.2, None, "deg", "above 61°"),
        (None, 19.6, "deg", "below 20°"),
        (None, None, "deg", "any value"),
        (500.0, 1300.0, "N/m", "500 to 1300 N/m"),
        (500.0, None, "kpa/m", "above 500 kPa/m"),
        (171.0, 189.0, "deg", "171° to 180° and on to 9°"),
        (201.0, 239.0, "deg", "201° to 239°"),
        (59.9999998, 60.0, "deg", "60.00° to 60.00°"),
    ],
)
def test_a_set_reads_as_words(lower, upper, unit, text):
    assert format_range(lower, upper, unit, is_axis=True) == text


def test_an_angle_with_ends_does_not_start_again_at_a_half_turn():
    assert format_range(171.0, 189.0, "deg") == "171° to 189°"


def test_alternatives_are_joined_as_in_a_sentence():
    assert join_or(["38°", "42°", "61°"]) == "38°, 42° or 61°"


@pytest.mark.parametrize(
    "attack", ["\x1b[2J", "\r", "\u202e", "\u200b", "\x00", "\ud800", "\x9b31m", "\n"]
)
def test_no_character_that_moves_a_cursor_survives(attack):
    assert printable(f"a{attack}b").isascii()
    assert printable(f"a{attack}b").isprintable()


def test_letters_of_any_script_survive():
    assert printable("Größe 押す ☂") == "Größe 押す ☂"


def test_units_of_tables_are_spelled_for_readers():
    assert [unit_label(u) for u in ("kpa", "n", "1", "N·m/rad")] == [
        "kPa",
        "N",
        "",
        "N·m/rad",
    ]
