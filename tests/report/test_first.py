"""The first lines of an answer: what is known before the posterior."""

from types import SimpleNamespace

import pytest

from pushfit.report.text.first import fit_line, set_line


def fit(*modes: tuple[float | None, float]):
    return SimpleNamespace(
        modes=[
            SimpleNamespace(theta_c_deg=angle, chi_square=cost) for angle, cost in modes
        ]
    )


@pytest.mark.parametrize(
    ("modes", "said"),
    [
        ([(41.26, 50.0)], "best fit: θ_c = 41.3° at α = 90°"),
        (
            [(41.26, 50.0), (63.0, 51.5), (None, 51.6), (20.0, 55.0)],
            "best fit: θ_c = 41.3° at α = 90°; 63.0° fits nearly as well",
        ),
        ([(None, 50.0)], "best fit: a contact that never rolls, without a θ_c"),
    ],
)
def test_the_best_fit_is_said_with_what_fits_as_well(modes, said):
    assert fit_line(fit(*modes), 90.0) == said


@pytest.mark.parametrize(
    ("pieces", "said"),
    [
        (((38.0, 42.0), (56.0, None)), "38.0° to 42.0° or above 56°"),
        (((None, None),), "any value"),
        ((), "empty"),
    ],
)
def test_the_set_is_said_in_all_its_pieces(pieces, said):
    profile = SimpleNamespace(pieces=pieces, prob=0.9)
    assert set_line(profile) == f"likelihood set of θ_c (90 %): {said}"
