"""The first lines of an answer: what is known before the posterior."""

from types import SimpleNamespace

import numpy as np
import pytest

from pushfit.fit.identify.fitted import Fitted
from pushfit.fit.problem.setup import Setup
from pushfit.fit.results import LikelihoodProfile, Mode, Verdict
from pushfit.fit.results.fits_along import Curve, FitsAlong
from pushfit.report.text.first_look import FirstLook


def partly(kind, **known):
    """A record of which only some fields are known."""
    record = object.__new__(kind)
    for name, value in known.items():
        object.__setattr__(record, name, value)
    return record


def by(mechanics: str, search: FitsAlong | None = None) -> Setup:
    """A problem by some mechanics."""
    problem = SimpleNamespace(grasp=SimpleNamespace(mechanics=mechanics))
    return partly(Setup, problem=problem, search=search)


@pytest.mark.parametrize(
    ("modes", "words"),
    [
        ([(41.26, 50.0)], "θ_c = 41.3° at α = 90°"),
        (
            [(41.26, 50.0), (42.9, 50.1), (63.0, 51.5), (None, 51.6), (20.0, 55.0)],
            "θ_c = 41.3° at α = 90°; 63.0° fits nearly as well",
        ),
        (
            [(41.26, 50.0), (44.0, 51.5)],
            "θ_c = 41.3° at α = 90°; 44.0° fits nearly as well",
        ),
        (
            [(None, 50.0)],
            "no θ_c, the contact never rolls",
        ),
    ],
)
def test_the_best_fit_is_said_with_what_fits_as_well(modes, words):
    found = [
        Mode(coordinates={}, theta_c_deg=angle, chi_square=cost)
        for angle, cost in modes
    ]
    said, fit = [], SimpleNamespace(modes=found)
    fitted = partly(Fitted, setup=by("linear"), fit=fit, reference_alpha=np.pi / 2)
    FirstLook(tell=said.append).fitted(fitted)
    assert said == [f"best fit by linear mechanics: {words}"]


@pytest.mark.parametrize(
    ("quantity", "costs", "words"),
    [
        ("theta_c", [9.0, 2.0, 5.0], ["θ_c near 40° at α = 90°"]),
        ("theta_c", [np.inf] * 3, []),
        ("ln_A", [9.0, 2.0, 5.0], []),
    ],
)
def test_the_first_look_says_where_the_fit_is_best(quantity, costs, words):
    values = np.radians([20.0, 40.2, 60.0])
    curve = Curve(values=values, points=np.zeros((3, 0)), chi_square=np.array(costs))
    search = FitsAlong(
        observed=np.zeros((1, 0)),
        quantity=quantity,
        reference_alpha=np.pi / 2,
        is_thorough=True,
        curve=curve,
        valleys=curve.points,
    )
    said = []
    FirstLook(tell=said.append).searched(by("tilting", search))
    assert said == [f"first look by tilting mechanics: {found}" for found in words]


@pytest.mark.parametrize(
    ("pieces", "words"),
    [
        (((38.0, 42.0), (56.0, None)), "38.0° to 42.0° or above 56°"),
        (((None, None),), "any value"),
        ((), "empty"),
    ],
)
def test_the_set_is_said_in_all_its_pieces(pieces, words):
    profile = LikelihoodProfile(
        name="theta_c",
        unit="deg",
        values=np.zeros(0),
        delta_chi_square=np.zeros(0),
        pieces=pieces,
        prob=0.9,
        verdict=Verdict.DETERMINED,
    )
    said = []
    for angle in (40.0, None):
        fit = SimpleNamespace(modes=[SimpleNamespace(theta_c_deg=angle)])
        fitted = partly(Fitted, setup=by("tilting"), fit=fit)
        FirstLook(tell=said.append).confined(fitted, profile)
    set_of = "likelihood set of θ_c (90 %, tilting)"
    # Beside a best fit that never rolls.
    others = f"{set_of}, where the contact rolls: {words}"
    assert said == [f"{set_of}: {words}", others]
