"""The first lines of an answer: what is known before the posterior."""

import numpy as np
import pytest

from pushfit.fit.results import FitResult, LikelihoodProfile, Mode, Verdict
from pushfit.fit.results.search import Curve, Search
from pushfit.report.text.first import fit_line, look_line, set_line


def fit(*modes: tuple[float | None, float]) -> FitResult:
    """A fit of which only the modes are known."""
    result = object.__new__(FitResult)
    found = tuple(
        Mode(coordinates={}, theta_c_deg=angle, chi_square=cost)
        for angle, cost in modes
    )
    object.__setattr__(result, "modes", found)
    return result


@pytest.mark.parametrize(
    ("modes", "said"),
    [
        ([(41.26, 50.0)], "θ_c = 41.3° at α = 90°"),
        (
            [(41.26, 50.0), (42.9, 50.1), (63.0, 51.5), (None, 51.6), (20.0, 55.0)],
            "θ_c = 41.3° at α = 90°; 63.0° fits nearly as well",
        ),
        (
            [(None, 50.0)],
            "no θ_c, the contact never rolls",
        ),
    ],
)
def test_the_best_fit_is_said_with_what_fits_as_well(modes, said):
    expected = f"best fit by linear mechanics: {said}"
    assert fit_line(fit(*modes), 90.0, "linear") == expected


@pytest.mark.parametrize(
    ("quantity", "costs", "said"),
    [
        ("theta_c", [9.0, 2.0, 5.0], "θ_c near 40° at α = 90°"),
        ("theta_c", [np.inf] * 3, None),
        ("ln_A", [9.0, 2.0, 5.0], None),
    ],
)
def test_the_first_look_says_where_the_fit_is_best(quantity, costs, said):
    values = np.radians([20.0, 40.2, 60.0])
    curve = Curve(values=values, points=np.zeros((3, 0)), chi_square=np.array(costs))
    search = Search(
        observed=np.zeros((1, 0)),
        quantity=quantity,
        reference_alpha=np.pi / 2,
        is_thorough=True,
        curve=curve,
        valleys=curve.points,
    )
    expected = said and f"first look by tilting mechanics: {said}"
    assert look_line(search, "tilting") == expected


@pytest.mark.parametrize(
    ("pieces", "said"),
    [
        (((38.0, 42.0), (56.0, None)), "38.0° to 42.0° or above 56°"),
        (((None, None),), "any value"),
        ((), "empty"),
    ],
)
def test_the_set_is_said_in_all_its_pieces(pieces, said):
    profile = LikelihoodProfile(
        name="theta_c",
        unit="deg",
        values=np.zeros(0),
        delta_chi_square=np.zeros(0),
        pieces=pieces,
        prob=0.9,
        verdict=Verdict.DETERMINED,
    )
    expected = f"likelihood set of θ_c (90 %, tilting): {said}"
    assert set_line(profile, "tilting") == expected
