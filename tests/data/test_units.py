"""Units are read from names, converted exactly, and doubted when numbers say so."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pushfit.data.units import (
    BIOTAC_PDC,
    UNITS,
    implausible_angles,
    implausible_signal,
    in_degrees,
    parse_unit,
    split_unit,
)
from pushfit.errors import ConfigError

TWO_ROUNDINGS = 5e-16  # of float64


@pytest.mark.parametrize(
    ("name", "stem", "unit"),
    [
        ("pressure_kpa", "pressure", "kpa"),
        ("p0_Pa", "p0", "pa"),
        ("fz_N", "fz", "n"),
        ("Force (mN)", "Force", "mn"),
        ("theta [deg]", "theta", "deg"),
        ("t_end_s", "t_end", "s"),
        (" pdc_counts ", "pdc", "counts"),
        ("pdc", "pdc", None),
        ("_n", "_n", None),
        ("pressure_kpa_mean", "pressure_kpa_mean", None),
        ("(n)", "(n)", None),
        ("s", "s", None),
    ],
)
def test_a_unit_is_the_suffix_or_in_brackets(name, stem, unit):
    found_stem, found = split_unit(name)
    assert found_stem == stem
    assert (found.name if found else None) == unit


@given(st.text(max_size=30))
def test_any_name_splits_without_harm(name):
    stem, unit = split_unit(name)
    assert stem in name
    assert unit is None or unit.name in UNITS


@pytest.mark.parametrize(
    ("unit", "value", "canonical"),
    [
        ("mn", 1500.0, 1.5),
        ("pa", 98447.75, 98.44775),
        ("ms", 20.0, 0.02),
        ("us", 3.0, 3e-6),
        ("ns", 7.0, 7e-9),
        ("min", 1.5, 90.0),
        ("deg", 180.0, np.pi),
        ("mm", 5.0, 0.005),
        ("kpa", 0.1, 0.1),
        ("counts", 2440.0, 2440.0),
    ],
)
def test_conversion_is_correctly_rounded(unit, value, canonical):
    found = UNITS[unit].to_canonical(np.array([value]))
    np.testing.assert_allclose(found, canonical, rtol=TWO_ROUNDINGS, atol=0)


@given(
    st.integers(-(2**53), 2**53), st.sampled_from(["mn", "pa", "ms", "us", "ns", "mm"])
)
def test_decimal_prefixes_are_correctly_rounded(value, unit):
    """Multiplying by 1e-3 is off in the last digit for one integer in three."""
    found = UNITS[unit].to_canonical(np.array([float(value)]))
    assert found[0] == float(Fraction(value) / int(UNITS[unit].per))


@pytest.mark.parametrize("unit", UNITS.values(), ids=list(UNITS))
def test_every_canonical_unit_is_a_unit_that_stays_as_it_is(unit):
    canonical = UNITS[unit.canonical]
    assert canonical.quantity == unit.quantity
    assert canonical.to_canonical(np.array([0.1])) == 0.1


def test_an_unknown_unit_names_the_nearest():
    with pytest.raises(ConfigError, match="did you mean 'counts'") as caught:
        parse_unit("count")
    assert caught.value.code == "unknown_unit"


@pytest.mark.parametrize("unit", ["kN", "MPa", "hPa", "ks"])
def test_a_unit_with_a_prefix_is_never_one_without(unit):
    with pytest.raises(ConfigError) as caught:
        parse_unit(unit)
    assert "did you mean" not in str(caught.value)
    assert str(caught.value).endswith("convert to one of these")


def test_the_biotac_constant_says_where_it_comes_from():
    assert BIOTAC_PDC.factor == 0.0365
    assert (BIOTAC_PDC.source_unit, BIOTAC_PDC.target_unit) == ("counts", "kpa")
    assert "Manual" in BIOTAC_PDC.provenance


KPA = UNITS["kpa"]


@pytest.mark.parametrize(
    "values",
    [
        np.array([101.3, 101.4]),
        np.array([5.0, 7.0, 0.0]),
        np.array([-1500.5, 1200.25]),
        np.array([np.nan]),
        np.array([]),
    ],
    ids=["atmosphere", "gauge", "large", "missing", "none"],
)
def test_pressures_that_a_fingertip_can_have_are_plausible(values):
    assert implausible_signal(values, KPA) is None


def test_pascals_that_claim_to_be_kilopascals_are_doubted():
    assert "look like Pa" in implausible_signal(np.array([98447.75, 98448.5]), KPA)


def test_counts_and_pascals_are_plausible_as_what_they_are():
    assert implausible_signal(np.array([2440.0, 2441.0]), UNITS["counts"]) is None
    assert implausible_signal(np.array([98447.75]), UNITS["pa"]) is None


@pytest.mark.parametrize(
    ("theta", "alpha", "is_doubted"),
    [
        ([0.1, 1.5], [3.1, 6.2], True),
        ([0.1, 1.5], [90.0, 150.0], False),
        ([0.0, 0.0], [0.0, 0.0], False),
        ([0.1, 1.5], None, True),
        ([1.0, 2.0], None, False),
        ([np.nan, np.nan], None, False),
        # A sweep beside azimuths in degrees, up and down.
        (np.radians(np.arange(5.0, 86.0, 5.0)), 17 * [30.0], True),
        (np.radians(np.arange(-60.0, 61.0, 15.0)), 9 * [90.0], True),
        # What robots reach that are sent to 0° and 1°, and at all times.
        (np.random.default_rng(1).normal(0.0, 0.2, 2000), 2000 * [40.0], False),
        (np.random.default_rng(1).normal(1.0, 0.1, 12), np.arange(0, 180, 15.0), False),
        ([0.2, 0.6, 1.0, 1.4], 4 * [30.0], False),
        # Azimuths beside elevations in degrees, as somebody types them, or writes them.
        (6 * [15.0], [0.0, 0.52, 1.05, 1.57, 2.09, 2.62], True),
        (12 * [15.0], np.radians(np.arange(-180.0, 180.0, 30.0)), True),
        (7 * [15.0], np.arange(0.0, 7.0), False),
        (5 * [15.0], np.arange(0.0, 2.5, 0.5), False),
        (4 * [15.0], [0.0, 0.52, 1.05, 90.0], False),
        (2000 * [15.0], np.random.default_rng(1).normal(0.0, 0.2, 2000), False),
    ],
)
def test_angles_in_degrees_are_doubted_only_together(theta, alpha, is_doubted):
    angles = {"theta": (np.array(theta), UNITS["deg"])}
    if alpha is not None:
        angles["alpha"] = (np.array(alpha), UNITS["deg"])
    assert bool(implausible_angles(angles)) == is_doubted


def test_decimal_degrees_survive_radians_and_others_lose_nothing():
    stated = np.arange(-360_000, 360_001) / 1000
    np.testing.assert_array_equal(in_degrees(np.radians(stated)), stated)
    measured = np.random.default_rng(0).uniform(-3, 3, 1000)
    np.testing.assert_array_equal(in_degrees(measured), np.degrees(measured))
