"""What three programs say of θ_c when heights alone are fitted with six parameters.

    python -m benchmarks.inference.honesty [--draws 30] [--seed 0]

One grasp, pushed at 17 elevations with three repeats, its heights drawn anew for every
fit with 3 % noise. Only A, B and C_rr meet these heights, so three of the six
directions in parameter space are flat. SciPy and lmfit start from the medians of
pushfit's priors and are told the noise; θ_c and its standard error follow from their
covariance by the delta method, which lmfit applies itself to an expression.
"""

import argparse
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import lmfit
import numpy as np
import pandas as pd
from scipy import optimize, stats

from benchmarks.tables import FIRM, GRASP, HARD, NAMES, PUSH_LENGTH
from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.assess.reporting_rules import pieces_for
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.priors.distributions import default_priors
from pushfit.fit.results import FitStatus, Verdict

# Of the firm grasp: tan θ_c = 150 / (0.5 · 520).
THETA_C_DEG = float(np.degrees(np.arctan(150 / 260)))
# As in `benchmarks.coverage.one_sweep`, repeats and noise, too.
THETA = np.radians(np.arange(5.0, 90.0, 5.0))
REPEATS, NOISE = 3, 0.03
# Of intervals and sets.
PROB = 0.9
# All lognormal, whose first number is the median.
START = tuple(float(default_priors(None)[name].first) for name in NAMES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What one program says after one fit.

    Args:
        is_success: Whether it reports success.
        is_quoted: Whether it gives θ_c with an uncertainty that is finite and not 0.
        half_width: Half the width of its 90 % interval or set [deg].
        is_covered: Whether that holds the true θ_c.
        is_stiffness_quoted: Whether K_sn, which no height determines, comes with a ±
            that the data are said to support.
        error: Standard error of θ_c; NaN where there is none [deg].
    """

    is_success: bool
    is_quoted: bool
    half_width: float
    is_covered: bool
    is_stiffness_quoted: bool
    error: float


def heights(theta, K_sn, K_dn, K_st, C_rr, C_d, L):
    """Eqs. (12)-(14) of the paper in NumPy, as a user would write them."""
    A = K_sn * K_dn / (K_sn + K_dn)
    B = K_st * C_d / (L**2 * K_st + C_d)
    normal = A * PUSH_LENGTH * np.sin(theta)
    tangential = np.minimum(C_rr * normal, B * PUSH_LENGTH * np.cos(theta))
    return np.hypot(normal, tangential)


def theta_c(K_sn, K_dn, K_st, C_rr, C_d, L):
    """Eq. (11) [deg]."""
    A = K_sn * K_dn / (K_sn + K_dn)
    B = K_st * C_d / (L**2 * K_st + C_d)
    return np.degrees(np.arctan2(B, C_rr * A))


def by_curve_fit(table: PeakTable, seed: int) -> Answer:
    """SciPy's `curve_fit`."""
    y, sd = table.heights("height"), table.sd("height")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found, covariance = optimize.curve_fit(
                heights, table.theta, y, p0=START, sigma=sd, absolute_sigma=True
            )
        except RuntimeError:
            return answer(False, np.nan, np.nan, np.nan)
        slope = optimize.approx_fprime(
            found, lambda p: theta_c(*p), 1e-7 * np.abs(found)
        )
        error = np.sqrt(slope @ covariance @ slope)
        error_K_sn = np.sqrt(covariance[0, 0])
    return answer(True, theta_c(*found), error, error_K_sn)


def by_lmfit(table: PeakTable, seed: int) -> Answer:
    """lmfit's `Model.fit`, with positive parameters and θ_c as an expression."""
    model = lmfit.Model(heights)
    params = model.make_params(**dict(zip(NAMES, START, strict=True)))
    for name in NAMES:
        params[name].min = 0.0
    A, B = "(K_sn*K_dn/(K_sn + K_dn))", "(K_st*C_d/(L**2*K_st + C_d))"
    params.add("theta_c", expr=f"arctan2({B}, C_rr*{A})*180/pi")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = model.fit(
            table.heights("height"),
            params,
            theta=table.theta,
            weights=1 / table.sd("height"),
            scale_covar=False,
        )
    errors = [result.params[n].stderr for n in ("theta_c", "K_sn")]
    errors = [np.nan if error is None else error for error in errors]
    return answer(result.success, result.params["theta_c"].value, *errors)


def answer(is_success: bool, value: float, error: float, error_K_sn: float) -> Answer:
    """What a standard error says."""
    half_width = stats.norm.ppf((1 + PROB) / 2) * error
    is_quoted = bool(np.isfinite(error) and error > 0)
    return Answer(
        is_success=bool(is_success),
        is_quoted=is_quoted,
        half_width=float(half_width) if is_quoted else np.nan,
        is_covered=bool(is_quoted and abs(value - THETA_C_DEG) <= half_width),
        is_stiffness_quoted=bool(np.isfinite(error_K_sn)),
        error=float(error),
    )


def by_pushfit(table: PeakTable, seed: int) -> Answer:
    """`pushfit fit` with no knowledge but the push length."""
    text = f"[push]\nlength_mm = {1000 * PUSH_LENGTH}\n[report]\nprob = {PROB}\n"
    # The equations that the others are given.
    text += HARD
    config = parse_config(text, path="grasp.toml")
    found = identify_table(table, config, seed=seed, engine="sweep")
    pieces = [
        (0.0 if low is None else low, 90.0 if high is None else high)
        for low, high in pieces_for(found.theta_c)
    ]
    (K_sn,) = (q for q in found.parameters if q.name == "K_sn")
    return Answer(
        is_success=found.status is FitStatus.OK,
        is_quoted=bool(pieces),
        half_width=sum(high - low for low, high in pieces) / 2,
        is_covered=any(low <= THETA_C_DEG <= high for low, high in pieces),
        is_stiffness_quoted=K_sn.verdict in (Verdict.LEARNED, Verdict.DETERMINED),
        error=np.nan,
    )


PROGRAMS: dict[str, Callable[[PeakTable, int], Answer]] = {
    "SciPy curve_fit": by_curve_fit,
    "lmfit": by_lmfit,
    "pushfit": by_pushfit,
}


def draw(seed: int) -> PeakTable:
    """Heights of one noise draw."""
    tallest = float(np.max(heights(THETA, *(float(getattr(FIRM, n)) for n in NAMES))))
    return simulate_table(
        FIRM,
        GRASP,
        theta=THETA,
        alpha=0.0,
        repeats=REPEATS,
        noise=NOISE * tallest,
        rng=np.random.default_rng(seed),
        state_sd=True,
    )


def row(answers: list[Answer]) -> dict[str, str]:
    """Counts of what one program said."""
    errors = np.array([a.error for a in answers])
    widths = [a.half_width for a in answers if a.is_quoted]
    n_quoted = len(widths)
    is_delta = np.isfinite(errors).any() or n_quoted == 0
    return {
        "reports success": f"{sum(a.is_success for a in answers)}",
        "θ_c ± 0 or none": f"{sum(not a.is_quoted for a in answers)}",
        "θ_c ± over 90°": f"{np.sum(errors > 90)}" if is_delta else "0",
        "half width, median": f"{np.median(widths):.3g}°" if widths else "",
        "90 % holds the truth": f"{sum(a.is_covered for a in answers)} of {n_quoted}",
        "K_sn ± as if measured": f"{sum(a.is_stiffness_quoted for a in answers)}",
    }


def main() -> None:
    """Print one table: a column for each program, a line for each question."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.draws)
    tables = {seed: draw(seed) for seed in seeds}
    columns = {
        name: row([program(table, seed) for seed, table in tables.items()])
        for name, program in PROGRAMS.items()
    }
    print(pd.DataFrame(columns).to_string())
    low, high = stats.binom.interval(0.99, options.draws, PROB)
    print(
        f"{options.draws} draws, true θ_c = {THETA_C_DEG:.1f}°; a 90 % interval that "
        f"means it holds the truth {low:.0f} to {high:.0f} times (99 % binomial)"
    )


if __name__ == "__main__":
    main()
