"""Hand-made results, one for every kind of answer a report must be able to give."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pushfit.config import GraspConfig
from pushfit.data.recording import Source
from pushfit.data.table import PeakTable
from pushfit.fit.results import (
    Band,
    Combination,
    Diagnostics,
    FitResult,
    FitStatus,
    GoodnessOfFit,
    IdentifiabilityResult,
    Identification,
    LikelihoodProfile,
    Mode,
    Notice,
    PosteriorResult,
    Quantity,
    Verdict,
)

PUSH_LENGTH = 0.005
TRUTH = {
    "K_sn": 800.0,
    "K_dn": 1486.0,
    "K_st": 400.0,
    "C_rr": 0.3,
    "C_d": 0.152,
    "L": 0.04,
}
A, B = 520.0, 77.0
N_DRAWS = 2000
HOSTILE = "<script>alert(1)</script>\x1b[31m\u202e'\"&{{7*7}}$\\frac$\n../x"


def heights(theta_deg, alpha_deg):
    """Linear, hard switch, soft axis at 65°: written out by hand on purpose."""
    theta, alpha = np.radians(theta_deg), np.radians(alpha_deg)
    tangential = B * (1 - 0.4 * np.cos(2 * (alpha - np.radians(65.0))))
    rolled = A * TRUTH["C_rr"] * np.sin(theta)
    force = np.minimum(tangential * np.cos(theta), rolled)
    return PUSH_LENGTH * np.hypot(force, A * np.sin(theta))


def make_table(*, with_alpha: bool) -> PeakTable:
    """17 elevations x 3 repeats at 90°, and 6 azimuths x 3 at 60°."""
    theta = np.repeat(np.arange(5.0, 86.0, 5.0), 3)
    alpha = np.full(theta.size, 90.0)
    if with_alpha:
        theta = np.append(theta, np.full(18, 60.0))
        alpha = np.append(alpha, np.repeat(np.arange(0.0, 151.0, 30.0), 3))
    clean = heights(theta, alpha)
    noise = np.random.default_rng(7).normal(size=theta.size)
    flags = [""] * theta.size
    flags[4] = "saturated"
    table = PeakTable.from_arrays(
        theta=np.radians(theta),
        alpha=np.radians(alpha),
        heights={"height": clean * (1 + 0.03 * noise)},
        sd={"height": 0.03 * clean},
        unit="n",
        flags=tuple(flags),
    )
    source = Source(path="theta_sweep.csv", sha256="ab" * 32, dialect="peak table, csv")
    return replace(table, sources=(source,), notes=("one push is saturated",))


def make_quantity(name: str, estimate: float, **changes: object) -> Quantity:
    """A learned quantity with a 5 % posterior."""
    interval = (0.92 * estimate, 1.08 * estimate)
    base = Quantity(
        name=name,
        unit="1",
        estimate=estimate,
        interval=interval,
        prob=0.9,
        sets=(interval,),
        likelihood_sets=(interval,),
        verdict=Verdict.LEARNED,
        contraction=0.97,
        note="lognormal prior",
    )
    return replace(base, **changes)


def make_angle(name: str, estimate: float | None, **changes: object) -> Quantity:
    """An angle, determined to two degrees unless changed."""
    interval = None if estimate is None else (estimate - 2.0, estimate + 2.0)
    sets = () if interval is None else (interval,)
    base = Quantity(
        name=name,
        unit="deg",
        estimate=estimate,
        interval=interval,
        prob=0.9,
        sets=sets,
        likelihood_sets=sets,
        verdict=Verdict.DETERMINED,
        contraction=None,
        note="",
    )
    return replace(base, **changes)


def make_bands(table: PeakTable) -> tuple[Band, ...]:
    """One band per sweep, 3 % wide."""
    frame = table.frame
    bands = []
    for swept, other, fixed in (
        ("theta", "alpha", 90.0),
        ("alpha", "theta", 60.0),
    ):
        rows = np.flatnonzero(frame[f"{other}_deg"].round(9) == fixed)
        angles = frame[f"{swept}_deg"].to_numpy()[rows]
        if np.unique(angles).size < 3:
            continue
        grid = np.linspace(angles.min(), angles.max(), 60)
        rest = np.full(grid.size, fixed)
        pair = (grid, rest) if swept == "theta" else (rest, grid)
        middle = heights(*pair)
        bands.append(
            Band(
                channel="height",
                swept=swept,
                fixed_deg=fixed,
                angle_deg=grid,
                lower=0.97 * middle,
                median=middle,
                upper=1.03 * middle,
                best_fit=middle,
                prob=0.9,
                rows=tuple(int(row) for row in rows),
            )
        )
    return tuple(bands)


def make_posterior(*, with_alpha: bool) -> PosteriorResult:
    """Lognormal draws about the truth, priors ten times wider; a small chain."""
    rng = np.random.default_rng(3)
    values = TRUTH | {"A": A, "B": B}
    samples, prior = {}, {}
    for name, value in values.items():
        samples[name] = value * np.exp(0.05 * rng.normal(size=N_DRAWS))
        prior[name] = value * np.exp(0.5 * rng.normal(size=N_DRAWS))
    # The data fix A, so that the two stiffnesses in series move against each other.
    samples["K_dn"] = 1 / (1 / samples["A"] - 1 / samples["K_sn"])
    samples["theta_c"] = rng.normal(40.0, 1.2, N_DRAWS)
    prior["theta_c"] = rng.uniform(0.0, 90.0, N_DRAWS)
    if with_alpha:
        for name, mean in {"e1": -0.9, "e2": -1.1, "f1": -0.7, "f2": -0.8}.items():
            samples[name] = rng.normal(mean, 0.1, N_DRAWS)
            prior[name] = rng.normal(0.0, 0.5, N_DRAWS)
        samples["alpha_star"] = rng.normal(65.0, 1.2, N_DRAWS)
        prior["alpha_star"] = rng.uniform(0.0, 180.0, N_DRAWS)
    names = ("ln_A", "ln_B", "ln_C_rr")
    return PosteriorResult(
        samples=samples,
        prior_samples=prior,
        log_prob=-0.5 * rng.chisquare(3, N_DRAWS),
        chain=rng.normal(size=(2, 50, 8, 3)),
        chain_names=names,
        thin=2,
        engine="emcee",
        diagnostics=Diagnostics(
            autocorr_time=dict.fromkeys(names, 23.0),
            ess=dict.fromkeys(names, 3400.0),
            rhat=dict.fromkeys(names, 1.002),
            acceptance_fraction=np.full((2, 8), 0.31),
            n_steps=100,
            n_ensembles=2,
            n_walkers=8,
            problems=(),
        ),
        log_evidence=None,
        log_evidence_error=None,
        seed=11,
        status=FitStatus.OK,
    )


def make_fit(table: PeakTable) -> FitResult:
    """The truth as the best fit, with one optimum."""
    used = np.flatnonzero(table.is_used)
    predicted = heights(np.degrees(table.theta), np.degrees(table.alpha))[used]
    sigma = table.sd("height")[used]
    chi_square = float(
        np.sum(((table.heights("height")[used] - predicted) / sigma) ** 2)
    )
    covariance = np.diag([1e-4, 4e-3, 2e-3])
    return FitResult(
        names=("ln_A", "ln_B", "ln_C_rr"),
        estimate=np.log([A, B, TRUTH["C_rr"]]),
        covariance=covariance,
        jacobian=np.ones((used.size, 3)),
        singular_values=np.array([90.0, 16.0, 4.0]),
        modes=(
            Mode(
                coordinates={"ln_A": np.log(A)}, theta_c_deg=40.1, chi_square=chi_square
            ),
        ),
        chi_square=chi_square,
        n_data=used.size,
        n_free=3,
        sigma=sigma,
        predicted=predicted,
        channel=("height",) * used.size,
        row=tuple(int(row) for row in used),
        status=FitStatus.OK,
    )


def make_parameters(*, with_alpha: bool) -> tuple[Quantity, ...]:
    """The six: C_rr learned, L fixed, the rest leaning on their priors."""
    assumed = {"verdict": Verdict.ASSUMED, "contraction": 0.08}
    parameters = [
        make_quantity("K_sn", 800.0, unit="N/m", interval=(500.0, 1300.0), **assumed),
        make_quantity(
            "K_dn",
            1486.0,
            unit="N/m",
            interval=(1210.0, 2034.0),
            verdict=Verdict.PARTLY,
            contraction=0.55,
        ),
        make_quantity("K_st", 400.0, unit="N/m", interval=(180.0, 900.0), **assumed),
        make_quantity("C_rr", 0.3),
        make_quantity("C_d", 0.152, unit="N·m/rad", interval=(0.061, 0.402), **assumed),
        make_quantity(
            "L",
            0.04,
            unit="m",
            interval=None,
            sets=(),
            likelihood_sets=(),
            verdict=Verdict.FIXED,
            contraction=None,
            note="fixed by the configuration",
        ),
    ]
    if with_alpha:
        parameters += [
            make_quantity(name, mean, interval=(mean - 0.2, mean + 0.2))
            for name, mean in (("e1", -0.9), ("e2", -1.1))
        ]
    return tuple(parameters)


@pytest.fixture(scope="session")
def make_identification() -> Callable[..., Identification]:
    """Maker of results: determined unless changed, with or without an α sweep."""

    def make(
        *, with_alpha: bool = True, config: GraspConfig | None = None, **changes: object
    ) -> Identification:
        table = make_table(with_alpha=with_alpha)
        fit = make_fit(table)
        grid = np.linspace(0.0, 90.0, 181)
        alpha_star = make_angle("alpha_star", 65.0)
        free = make_angle("alpha_star", 66.0)
        if not with_alpha:
            free = None
            alpha_star = make_angle(
                "alpha_star",
                None,
                verdict=Verdict.NOT_DETERMINED,
                note="all pushes have the azimuth 90°",
            )
        base = Identification(
            table=table,
            used=table.is_used,
            config=config or GraspConfig(push={"length_mm": 5.0}),
            fit=fit,
            posterior=make_posterior(with_alpha=with_alpha),
            theta_c=make_angle("theta_c", 40.123),
            reference_alpha_deg=90.0,
            alpha_star=alpha_star,
            alpha_star_model_free=free,
            parameters=make_parameters(with_alpha=with_alpha),
            combinations=(
                make_quantity(
                    "A",
                    A,
                    unit="N/m",
                    note="K_sn K_dn/(K_sn + K_dn)",
                    interval=(511.0, 529.0),
                ),
                make_quantity("B", B, unit="N/m", note="K_st C_d/(L² K_st + C_d)"),
            ),
            profiles={
                "theta_c": LikelihoodProfile(
                    name="theta_c",
                    unit="deg",
                    values=grid,
                    delta_chi_square=((grid - 40.0) / 1.2) ** 2,
                    pieces=((38.0, 42.0),),
                    prob=0.9,
                    verdict=Verdict.DETERMINED,
                )
            },
            identifiability=IdentifiabilityResult(
                combinations=(
                    Combination(
                        formula="K_sn K_dn/(K_sn + K_dn)",
                        singular_value=90.0,
                        is_determined=True,
                    ),
                    Combination(
                        formula="K_sn/K_dn", singular_value=0.0, is_determined=False
                    ),
                ),
                rank=3,
                n_parameters=5,
                advice=("Measure L with callipers: it would separate K_st and C_d.",),
            ),
            goodness_of_fit=GoodnessOfFit(
                chi_square=fit.chi_square,
                degrees_of_freedom=fit.degrees_of_freedom,
                p_value=0.46,
                r_squared=0.9981,
                lack_of_fit_p_value=0.31,
                pattern_p_value=0.55,
                outliers=(),
                is_adequate=True,
                sentence="The model describes these data.",
            ),
            bands=make_bands(table),
            warnings=(
                Notice(code="pushes_left_out", text="1 push was left out: saturated."),
            ),
            status=FitStatus.OK,
            seed=11,
            versions={"pushfit": "0.1.0", "jax": "0.10.2"},
        )
        return replace(base, **changes)

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
        sentence="χ² = 812 for 65 degrees of freedom; residuals follow the elevation.",
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
    notice = Notice(code="hostile", text=HOSTILE)
    advice = replace(determined.identifiability, advice=(HOSTILE,))
    parameters = tuple(replace(q, note=HOSTILE) for q in determined.parameters)
    return make_identification(
        table=replace(determined.table, sources=(source,), notes=(HOSTILE,)),
        goodness_of_fit=quality,
        warnings=(notice,),
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
