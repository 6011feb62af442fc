"""Hand-made results, one for every kind of answer a report must be able to give."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pushfit.config import GraspConfig
from pushfit.data.text.files import Source
from pushfit.fit.assess.reporting_rules import reported
from pushfit.fit.results import (
    FitStatus,
    Identification,
    Mode,
    ResultWarning,
    Verdict,
)
from tests.report.makers import HOSTILE, make_angle, make_whole


@pytest.fixture(scope="session")
def make_identification() -> Callable[..., Identification]:
    """Maker of results: determined unless changed, with or without an α sweep."""

    def make(*, with_alpha: bool = True, **changes: object) -> Identification:
        return reported(replace(make_whole(with_alpha=with_alpha), **changes))

    return make


@pytest.fixture
def determined(make_identification) -> Identification:
    """Both angles determined."""
    return make_identification()


@pytest.fixture
def theta_only(make_identification) -> Identification:
    """No azimuth sweep: α* cannot be known."""
    return make_identification(with_alpha=False)


@pytest.fixture
def two_modes(make_identification, determined) -> Identification:
    """θ_c is 40° or 56°."""
    rng = np.random.default_rng(5)
    draws = np.append(rng.normal(40.0, 0.9, 1200), rng.normal(56.0, 0.9, 800))
    samples = dict(determined.posterior.samples) | {"theta_c": draws}
    pieces = ((38.4, 41.6), (54.4, 57.6))
    modes = (
        *determined.fit.modes,
        Mode(coordinates={"ln_A": 6.2}, theta_c_deg=56.0, chi_square=69.3),
    )
    grid = np.linspace(0.0, 90.0, 181)
    profile = replace(
        determined.profiles["theta_c"],
        delta_chi_square=np.minimum(
            ((grid - 40) / 1.2) ** 2, ((grid - 56) / 1) ** 2 + 1
        ),
        pieces=pieces,
    )
    return make_identification(
        theta_c=make_angle(
            "theta_c",
            41.0,
            interval=(38.6, 57.2),
            sets=pieces,
            likelihood_sets=pieces,
            verdict=Verdict.SEVERAL_MODES,
        ),
        fit=replace(determined.fit, modes=modes),
        posterior=replace(determined.posterior, samples=samples),
        profiles={"theta_c": profile},
    )


@pytest.fixture
def one_sided(make_identification) -> Identification:
    """θ_c is above 61°."""
    open_set = ((61.2, None),)
    return make_identification(
        theta_c=make_angle(
            "theta_c",
            72.0,
            interval=(61.9, 88.1),
            sets=open_set,
            likelihood_sets=open_set,
            verdict=Verdict.ONE_SIDED,
        )
    )


@pytest.fixture
def not_determined(make_identification) -> Identification:
    """θ_c may be anything; every parameter comes from its prior."""
    return make_identification(
        theta_c=make_angle(
            "theta_c",
            47.0,
            interval=(4.0, 88.0),
            sets=((3.0, 88.0),),
            likelihood_sets=((None, None),),
            verdict=Verdict.NOT_DETERMINED,
            note="all pushes have the elevation 15°",
        )
    )


@pytest.fixture
def prior_dominated(make_identification, determined) -> Identification:
    """Nothing but the prior is known of A, and its likelihood set is open."""
    first, second = determined.combinations
    verdict = Verdict.NOT_DETERMINED
    first = replace(first, verdict=verdict, likelihood_sets=((None, None),))
    return make_identification(combinations=(first, second))


@pytest.fixture
def not_converged(make_identification, determined) -> Identification:
    """The chain is too short to quote anything from it."""
    posterior = determined.posterior
    diagnostics = replace(
        posterior.diagnostics, problems=("ln_B: 100 steps are fewer than 50 τ",)
    )
    status = FitStatus.NOT_CONVERGED
    return make_identification(
        status=status,
        posterior=replace(posterior, status=status, diagnostics=diagnostics),
    )


@pytest.fixture
def inadequate(make_identification, determined) -> Identification:
    """The model does not describe the data."""
    quality = replace(
        determined.goodness_of_fit,
        p_value=1e-9,
        r_squared=0.61,
        is_adequate=False,
        outliers=("push 12 (θ 20°, α 90°)",),
        sentence="The model does not describe these heights: χ² = 812 for 65.",
    )
    return make_identification(goodness_of_fit=quality)


@pytest.fixture
def unknown_length(make_identification) -> Identification:
    """The push length is nominal: heights compare directions only."""
    config = GraspConfig(push={"length_mm": 5.0, "length_known": False})
    return make_identification(config=config)


@pytest.fixture
def hostile(make_identification, determined) -> Identification:
    """Everything a user can name is an attack on terminal, page and file."""
    source = Source(path=HOSTILE, sha256="00" * 32, dialect=HOSTILE)
    quality = replace(determined.goodness_of_fit, sentence=HOSTILE, outliers=(HOSTILE,))
    warning = ResultWarning(code="hostile", text=HOSTILE)
    advice = replace(determined.identifiability, advice=(HOSTILE,))
    parameters = tuple(replace(q, note=HOSTILE) for q in determined.parameters)
    return make_identification(
        table=replace(determined.table, sources=(source,), notes=(HOSTILE,)),
        goodness_of_fit=quality,
        warnings=(warning,),
        identifiability=advice,
        parameters=parameters,
        versions={"pushfit": HOSTILE},
        config=GraspConfig(
            push={"length_mm": 5.0}, peaks={"channel": "<img src=x onerror=y>"}
        ),
    )


KINDS = (
    "determined",
    "theta_only",
    "two_modes",
    "one_sided",
    "not_determined",
    "not_converged",
    "inadequate",
    "unknown_length",
    "hostile",
)


@pytest.fixture(params=KINDS)
def any_identification(request) -> Identification:
    """Each kind of result in turn."""
    return request.getfixturevalue(request.param)
