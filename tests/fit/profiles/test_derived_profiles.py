"""Sets of the six parameters: against springs in series, put together again."""

import numpy as np
import pytest

from pushfit.fit.profiles.derived_profiles import implied_profiles
from pushfit.fit.profiles.profile_sets import pieces_below, threshold, verdict_of
from pushfit.fit.results import LikelihoodProfile
from tests.fit.tables import case_table, setup_of
from tests.problems import CASES

SPRINGS = {"K_sn": 1200.0, "K_dn": 600.0, "K_st": 300.0, "C_d": 0.24, "L": 0.04}
# The two in series: 400 N/m across the thumb, and 100 N/m along it.
A, B = 400.0, 100.0
# Ends are placed between values a 4000th apart.
END = 1e-6


def whole_of(name, springs):
    """Least squares know the springs by what two in series come to."""
    if name in ("K_sn", "K_dn"):
        return 1 / (1 / springs["K_sn"] + 1 / springs["K_dn"])
    return 1 / (1 / springs["K_st"] + springs["L"] ** 2 / springs["C_d"])


def profile_about(name, value):
    """Of a log that is known to a tenth."""
    values = value * np.exp(np.linspace(-0.5, 0.5, 4001))
    delta = (np.log(values / value) / 0.1) ** 2
    pieces = pieces_below(values, delta, threshold(0.9, np.inf))
    return LikelihoodProfile(
        name=name,
        unit="N/m",
        values=values,
        delta_chi_square=delta,
        pieces=pieces,
        prob=0.9,
        verdict=verdict_of(pieces),
    )


def ends_of(profile):
    """Ends of a set in one piece, NaN where it has none."""
    (piece,) = profile.pieces
    return np.array(piece, dtype=float)


def implied(fixed, **profiles):
    lines = [f"[parameters.{name}]\nfixed = {value}\n" for name, value in fixed.items()]
    problem = setup_of(case_table(CASES["firm"], noise=0.02), "".join(lines)).problem
    return implied_profiles(problem, profiles, newton="N")


@pytest.mark.parametrize("name", SPRINGS)
def test_with_its_partners_a_spring_makes_the_whole(name):
    """The ends of its set, each put in series, are the ends of the whole."""
    fixed = {other: value for other, value in SPRINGS.items() if other != name}
    whole = profile_about(*(("A", A) if name in ("K_sn", "K_dn") else ("B", B)))
    profile = implied(fixed, **{whole.name: whole})[name]
    wholes = [whole_of(name, SPRINGS | {name: end}) for end in ends_of(profile)]
    np.testing.assert_allclose(sorted(wholes), ends_of(whole), rtol=END)
    assert np.all(np.diff(profile.values) > 0)


@pytest.mark.parametrize("firmness", [1.0, 0.9])
def test_a_whole_as_firm_as_one_spring_leaves_the_other_without_an_end(firmness):
    """A spring in series with K_st is as firm as can be where B is K_st, or beyond.

    Δχ² counts from the firmest whole that K_st can be part of.
    """
    values = profile_about("B", B).values
    K_st = values[np.searchsorted(values, firmness * B)]
    fixed = {"K_st": np.nextafter(K_st, np.inf), "L": SPRINGS["L"]}
    low, high = ends_of(implied(fixed, B=profile_about("B", B))["C_d"])
    assert np.isnan(high)
    level = threshold(0.9, np.inf) + (np.log(K_st / B) / 0.1) ** 2
    springs = SPRINGS | fixed | {"C_d": low}
    end = B * np.exp(-0.1 * np.sqrt(level))
    np.testing.assert_allclose(whole_of("C_d", springs), end, rtol=END)


PARTNERS = {"K_sn": "K_dn", "K_dn": "K_sn", "K_st": "C_d", "C_d": "K_st", "L": "K_st"}


@pytest.mark.parametrize("name", SPRINGS)
def test_without_one_partner_a_spring_is_bounded_by_the_whole(name):
    """As if that gave nothing: K_sn > A, C_d > B L², and L < sqrt(C_d / B)."""
    apart = {name, PARTNERS[name]}
    fixed = {other: value for other, value in SPRINGS.items() if other not in apart}
    whole = profile_about(*(("A", A) if name in ("K_sn", "K_dn") else ("B", B)))
    low, high = ends_of(implied(fixed, **{whole.name: whole})[name])
    assert np.isnan(low if name == "L" else high)
    springs = SPRINGS | {PARTNERS[name]: np.inf, name: high if name == "L" else low}
    np.testing.assert_allclose(whole_of(name, springs), ends_of(whole)[0], rtol=END)
