"""The same heights for curve_fit, lmfit, pyPESTO and pushfit, as users call them.

    python examples/comparison.py [--noise 0.03] [--seed 3]

17 elevations with three repeats and a known truth: θ_c = 30°. SciPy and lmfit get the
equations of the paper and the noise; pushfit gets the table and the push length.
"""

import argparse
import logging
import warnings

import lmfit
import numpy as np
import pandas as pd
from scipy.optimize import curve_fit

try:
    import pypesto
    import pypesto.optimize
    import pypesto.profile
except ImportError:
    pypesto = None

import pushfit
from pushfit.report.answers import theta_c_answer

PUSH_LENGTH = 0.005
TRUTH = {
    "K_sn": 1300,
    "K_dn": 2600 / 3,
    "K_st": 450,
    "C_rr": 0.5,
    "C_d": 0.36,
    "L": 0.04,
}
START = (1000.0, 2000.0, 500.0, 0.3, 0.5, 0.04)


def heights(theta, K_sn, K_dn, K_st, C_rr, C_d, L):
    """Eqs. (12) to (14) of He & Zhang (2014) [N]."""
    A = K_sn * K_dn / (K_sn + K_dn)
    B = K_st * C_d / (L**2 * K_st + C_d)
    normal = A * PUSH_LENGTH * np.sin(theta)
    tangential = np.minimum(C_rr * normal, B * PUSH_LENGTH * np.cos(theta))
    return np.hypot(normal, tangential)


def critical_angle(K_sn, K_dn, K_st, C_rr, C_d, L):
    """Eq. (11) [deg]."""
    A = K_sn * K_dn / (K_sn + K_dn)
    B = K_st * C_d / (L**2 * K_st + C_d)
    return np.degrees(np.arctan2(B, C_rr * A))


def make_table(noise: float, seed: int) -> pd.DataFrame:
    """Heights with noise, a share of the tallest, and their standard deviation."""
    theta = np.repeat(np.radians(np.arange(5.0, 90.0, 5.0)), 3)
    clean = heights(theta, **TRUTH)
    sd = noise * clean.max()
    noisy = clean + sd * np.random.default_rng(seed).standard_normal(theta.size)
    columns = {"theta_deg": np.degrees(theta), "alpha_deg": 0.0}
    return pd.DataFrame(columns | {"height_n": noisy, "height_sd_n": sd})


def by_curve_fit(frame: pd.DataFrame) -> str:
    """SciPy's `curve_fit`, and the delta method for θ_c."""
    theta, sd = np.radians(frame["theta_deg"]), frame["height_sd_n"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found, covariance = curve_fit(
            heights, theta, frame["height_n"], START, sd, absolute_sigma=True
        )
    steps = 1e-6 * np.abs(found)
    slope = [
        (critical_angle(*(found + step)) - critical_angle(*(found - step))) / (2 * h)
        for h, step in zip(steps, np.diag(steps), strict=True)
    ]
    with np.errstate(invalid="ignore"):
        error = np.sqrt(slope @ covariance @ slope)
        K_sn = f"K_sn = {found[0]:.4g} ± {np.sqrt(covariance[0, 0]):.2g} N/m"
    return f"theta_c = {critical_angle(*found):.1f} ± {error:.2g}°, {K_sn}"


def by_curve_fit_of_three(frame: pd.DataFrame) -> str:
    """`curve_fit` of A, B and C_rr, all that these heights depend on."""

    def three(theta, A, B, C_rr):
        normal = A * PUSH_LENGTH * np.sin(theta)
        elastic = B * PUSH_LENGTH * np.cos(theta)
        return np.hypot(normal, np.minimum(C_rr * normal, elastic))

    theta, sd = np.radians(frame["theta_deg"]), frame["height_sd_n"]
    start = (500.0, 300.0, 0.3)
    found, covariance = curve_fit(
        three, theta, frame["height_n"], start, sd, absolute_sigma=True
    )
    A, B, C_rr = found
    tangent = B / (C_rr * A)
    slope = np.degrees(tangent / (1 + tangent**2)) * np.array([-1, 1, -1]) / found
    error = np.sqrt(slope @ covariance @ slope)
    return f"theta_c = {np.degrees(np.arctan(tangent)):.1f} ± {error:.2g}°, no K_sn"


def by_lmfit(frame: pd.DataFrame) -> str:
    """`Model.fit` of lmfit, with positive parameters and θ_c as an expression."""
    model = lmfit.Model(heights)
    params = model.make_params(**dict(zip(TRUTH, START, strict=True)))
    for name in TRUTH:
        params[name].min = 0.0
    A, B = "(K_sn*K_dn/(K_sn + K_dn))", "(K_st*C_d/(L**2*K_st + C_d))"
    params.add("theta_c", expr=f"arctan2({B}, C_rr*{A})*180/pi")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = model.fit(
            frame["height_n"].to_numpy(),
            params,
            theta=np.radians(frame["theta_deg"].to_numpy()),
            weights=1 / frame["height_sd_n"].to_numpy(),
            scale_covar=False,
        )
    return f"{_quoted('theta_c', fit)}°, {_quoted('K_sn', fit)} N/m"


def _quoted(name: str, fit: lmfit.model.ModelResult) -> str:
    """A parameter as lmfit reports it."""
    parameter = fit.params[name]
    error = "none" if parameter.stderr is None else f"{parameter.stderr:.2g}"
    return f"{name} = {parameter.value:.4g} ± {error}"


def by_pypesto(frame: pd.DataFrame) -> str:
    """Twenty starts and a profile of pyPESTO, with θ_c as one of three parameters."""
    if pypesto is None:
        return "not installed; pip install pypesto"
    logging.disable(logging.WARNING)
    theta = np.radians(frame["theta_deg"].to_numpy())
    y, sd = frame["height_n"].to_numpy(), frame["height_sd_n"].to_numpy()

    def cost(x):
        A, C_rr, tangent = np.exp(x[0]), np.exp(x[1]), np.tan(np.radians(x[2]))
        normal = A * PUSH_LENGTH * np.sin(theta)
        elastic = C_rr * A * tangent * PUSH_LENGTH * np.cos(theta)
        predicted = np.hypot(normal, np.minimum(C_rr * normal, elastic))
        return 0.5 * np.sum(((predicted - y) / sd) ** 2)

    problem = pypesto.Problem(
        objective=pypesto.Objective(fun=cost),
        lb=[np.log(10), np.log(0.01), 1.0],
        ub=[np.log(1e4), np.log(5), 89.0],
    )
    optimizer = pypesto.optimize.ScipyOptimizer(method="Nelder-Mead")
    quiet = {"progress_bar": False, "filename": None}
    result = pypesto.optimize.minimize(
        problem, optimizer=optimizer, n_starts=20, **quiet
    )
    best = result.optimize_result.list[0].x[2]
    result = pypesto.profile.parameter_profile(
        problem, result=result, optimizer=optimizer, profile_index=[2], **quiet
    )
    profile = result.profile_result.list[0][2]
    low, high = pypesto.profile.calculate_approximate_ci(
        profile.x_path[2],
        profile.ratio_path,
        pypesto.profile.chi2_quantile_to_ratio(0.9),
    )
    return f"theta_c = {best:.1f}° (90 % profile: {low:.0f}° to {high:.0f}°), no K_sn"


def by_pushfit(frame: pd.DataFrame) -> str:
    """`identify`, told the table and the push length."""
    config = {"push": {"length_mm": 5.0}}
    found = pushfit.identify(frame, config=config)
    verdict = found.params["K_sn"].verdict.value
    return f"{theta_c_answer(found).sentence} K_sn: {verdict}."


def main() -> None:
    """Print one line for each program."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--noise", type=float, default=0.03)
    parser.add_argument("--seed", type=int, default=3)
    options = parser.parse_args()
    frame = make_table(options.noise, options.seed)
    print(f"{'truth':<24}theta_c = {critical_angle(**TRUTH):.1f}°, K_sn = 1300 N/m")
    for name, program in (
        ("curve_fit", by_curve_fit),
        ("lmfit", by_lmfit),
        ("curve_fit of A, B, C_rr", by_curve_fit_of_three),
        ("pyPESTO of three", by_pypesto),
        ("pushfit", by_pushfit),
    ):
        print(f"{name:<24}{program(frame)}")


if __name__ == "__main__":
    main()
