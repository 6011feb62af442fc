"""Parts of hand-made results, and a whole one: table, fit, posterior, quantities."""

from dataclasses import replace

import numpy as np

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.tables.traces import Trace
from pushfit.data.text.files import Source
from pushfit.fit.checks.push_densities import PushDensities
from pushfit.fit.comparison import (
    Comparison,
    ModelScore,
    against_best,
)
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
    MechanicsAnswer,
    Mode,
    PosteriorResult,
    PredictiveCheck,
    Quantity,
    ResultWarning,
    Verdict,
)
from pushfit.report.html import result as html
from pushfit.report.store import folder

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


def leave_out_figures(patch):
    """Folders and pages without figures."""
    patch.setattr(folder, "figure_files", lambda _, **__: {})
    patch.setattr(folder, "render_html", lambda _, **__: "")
    patch.setattr(html, "figure_files", lambda _, **__: {})
    patch.setattr(html, "main_figure", lambda _, **__: None)
    patch.setattr(html, "figure_bytes", lambda *_: b"<svg/>")


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
    middle = np.arange(table.n_pushes) + 0.5
    times = {"t_start_s": middle - 0.25, "t_peak_s": middle, "t_end_s": middle + 0.25}
    rests = {"baseline_n": np.zeros(table.n_pushes)}
    return replace(
        table,
        frame=table.frame.assign(**times, **rests),
        sources=(source,),
        notes=("one push is saturated",),
        traces=(make_trace(table),),
    )


def make_trace(table: PeakTable, *, path: str = "theta_sweep.csv") -> Trace:
    """One triangular push per second."""
    time = np.arange(0.0, table.n_pushes, 0.1)
    shape = np.clip(1 - 4 * np.abs(time % 1 - 0.5), 0, None)
    return Trace(
        path=path,
        name="force",
        unit="n",
        time=time,
        signal=shape * table.heights("height")[time.astype(int)],
        first_row=0,
        n_rows=table.n_pushes,
    )


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


def make_answer(
    mechanics: str,
    *,
    best: float | None = 40.0,
    width: float | None = 4.0,
    log_evidence: float | None = -10.0,
    chi_square: float = 50.0,
    rms_residual: float = 0.02,
) -> MechanicsAnswer:
    """What one of the mechanics says: an interval of some width about the best fit."""
    middle = 40.0 if best is None else best
    interval = None if width is None else (middle - width / 2, middle + width / 2)
    return MechanicsAnswer(
        mechanics=mechanics,
        theta_c=make_angle("theta_c", best, interval=interval),
        best_fit_deg=best,
        chi_square=chi_square,
        log_evidence=log_evidence,
        log_evidence_error=None if log_evidence is None else 0.1,
        rms_residual=rms_residual,
    )


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


def make_combinations() -> tuple[Quantity, ...]:
    """A and B, which the heights depend on."""
    return (
        make_quantity(
            "A",
            A,
            unit="N/m",
            note="K_sn K_dn/(K_sn + K_dn)",
            interval=(511.0, 529.0),
        ),
        make_quantity("B", B, unit="N/m", note="K_st C_d/(L² K_st + C_d)"),
    )


def make_profile() -> LikelihoodProfile:
    """A parabola of θ_c about 40°."""
    grid = np.linspace(0.0, 90.0, 181)
    return LikelihoodProfile(
        name="theta_c",
        unit="deg",
        values=grid,
        delta_chi_square=((grid - 40.0) / 1.2) ** 2,
        pieces=((38.0, 42.0),),
        prob=0.9,
        verdict=Verdict.DETERMINED,
    )


def make_identifiability() -> IdentifiabilityResult:
    """Three of five directions are known, the ratio of the springs is not."""
    return IdentifiabilityResult(
        directions=(
            Combination(
                formula="K_sn K_dn/(K_sn + K_dn)",
                singular_value=90.0,
                is_determined=True,
            ),
            Combination(formula="K_sn/K_dn", singular_value=0.0, is_determined=False),
        ),
        rank=3,
        n_parameters=5,
        advice=("Measure L with callipers: it would separate K_st and C_d.",),
    )


def make_goodness(fit: FitResult) -> GoodnessOfFit:
    """A model that describes the data."""
    return GoodnessOfFit(
        chi_square=fit.chi_square,
        degrees_of_freedom=fit.degrees_of_freedom,
        p_value=0.46,
        r_squared=0.9981,
        lack_of_fit_p_value=0.31,
        pattern_p_value=0.55,
        outliers=(),
        is_adequate=True,
        sentence="The model describes these data.",
        predictive=(
            PredictiveCheck(feature="scatter", p_value=0.42),
            PredictiveCheck(feature="largest", p_value=0.0),
        ),
    )


def make_directions(*, with_alpha: bool) -> tuple[Quantity, Quantity | None]:
    """The best direction by the model, and without one."""
    if with_alpha:
        return make_angle("alpha_star", 65.0), make_angle("alpha_star_model_free", 66.0)
    note = "all pushes have the azimuth 90°"
    unknown = {"verdict": Verdict.NOT_DETERMINED, "note": note}
    return make_angle("alpha_star", None, **unknown), None


def make_whole(*, with_alpha: bool) -> Identification:
    """All parts together, before what may be reported is decided."""
    table = make_table(with_alpha=with_alpha)
    fit = make_fit(table)
    alpha_star, free = make_directions(with_alpha=with_alpha)
    left_out = "1 push was left out: saturated."
    return Identification(
        table=table,
        used=table.is_used,
        config=GraspConfig(push={"length_mm": 5.0}),
        fit=fit,
        posterior=make_posterior(with_alpha=with_alpha),
        by_mechanics=(make_answer("linear", best=40.123),),
        theta_c=make_angle("theta_c", 40.123),
        reference_alpha_deg=90.0,
        alpha_star=alpha_star,
        alpha_star_model_free=free,
        parameters=make_parameters(with_alpha=with_alpha),
        combinations=make_combinations(),
        profiles={"theta_c": make_profile()},
        identifiability=make_identifiability(),
        goodness_of_fit=make_goodness(fit),
        bands=make_bands(table),
        warnings=(ResultWarning(code="pushes_left_out", text=left_out),),
        status=FitStatus.OK,
        seed=11,
        versions={"pushfit": "0.1.0", "jax": "0.10.2"},
    )


def make_comparison(
    *, evidence=(12.3, 11.9, -4.0), elpd=(0.0, -0.02, -0.9), **changes
) -> Comparison:
    """Scores of twenty pushes: hard and soft alike, no rolling far behind.

    Args:
        evidence: Log evidence of each model; None for none.
        elpd: Mean log density of a push under each model.
        changes: Other fields of every score.
    """
    # Differences between models scatter by tenths and have the mean asked for.
    wave = 0.1 * np.resize([1.0, -1.0], 20)
    densities = [
        PushDensities(
            elpd=mean + i * wave,
            p_loo=np.full(20, 0.1),
            pareto_k=np.full(20, 0.3),
            max_pareto_k=0.7,
        )
        for i, mean in enumerate(elpd)
    ]
    scores = [
        ModelScore(
            name=name,
            sharpness=8.0 if name == "soft" else np.inf,
            log_evidence=None if evidence is None else evidence[i],
            log_evidence_error=None if evidence is None else 1e-6,
            densities=densities[i],
            **{
                "is_adequate": True,
                "verdict": "The model describes the heights within their noise.",
                "engine": "sweep",
                "status": FitStatus.OK,
                **changes,
            },
        )
        for i, name in enumerate(("hard", "soft", "no_rolling"))
    ]
    return Comparison(
        models=against_best(scores),
        why_no_evidence=None
        if evidence
        else "the stiffness ellipse adds two dimensions",
        mechanics="linear",
        n_pushes=20,
        noise="given",
        seed=0,
    )
