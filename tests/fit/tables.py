"""Tables with known truth for the tests of the fit."""

import numpy as np

from pushfit.config import GraspConfig, parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.coverage import simulate_tables
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.problem.setup import Setup, build_problem
from pushfit.fit.profiles.least_squares import settle_noise
from pushfit.model import Parameters
from tests.problems import CASES

TOML = """
[push]
length_mm = 5.0
"""
# The switch of the paper, wherever a test does not ask for another transition, and
# normal noise: what chooses between kinds of noise compiles the programs of each.
HARD = '[transition]\nsharpness = "hard"\n'
NORMAL = '[noise]\nlikelihood = "normal"\n'
# Elevations whose three repeats fit the shortest problems: wherever a test does not ask
# for more pushes, as every length has programs of its own.
SEVEN_DEG = np.arange(10.0, 83.0, 12.0)

LOW_DEG = np.arange(5.0, 61.0, 5.0)

FIXED = {"K_sn": 1200, "K_dn": 600, "K_st": 300, "C_d": 0.24, "L": 0.04}
# With the truth of the case "paper" for all but C_rr, the tangential height of a push
# below θ_c is A C_rr S_p sin θ: linear in the only free parameter.
FRICTION_ONLY = "".join(f"[parameters.{n}]\nfixed = {v}\n" for n, v in FIXED.items())
FRICTION_ONLY += "[parameters.C_rr]\nnormal = { mean = 0.24, sd = 0.01 }\n"


def config(text: str = "") -> GraspConfig:
    """A push of 5 mm, and more text.

    The transition is hard and the noise is normal unless the text says otherwise.
    """
    transition = "" if "[transition]" in text else HARD
    if "likelihood =" not in text:
        noise = "[noise]\n"
        text = text.replace(noise, NORMAL) if noise in text else f"{text}\n{NORMAL}"
    return parse_config(TOML + transition + text, path="grasp.toml")


def case_table(
    case,
    *,
    noise: float = 0.0,
    seed: int = 0,
    repeats: int = 3,
    channels: tuple[str, ...] = ("height",),
    theta_deg=None,
    alpha_deg=None,
) -> PeakTable:
    """Pushes of a case of `problems.CASES`, drawn from its truth.

    With `alpha_deg` the pushes are those pairs, else every elevation at the azimuths
    of the case.
    """
    if alpha_deg is not None:
        theta, alpha = np.radians(theta_deg), np.radians(alpha_deg)
    else:
        pushes = case.pushes() if theta_deg is None else case.pushes(theta_deg)
        theta, alpha = np.asarray(pushes.theta), np.asarray(pushes.alpha)
    return simulate_table(
        case.params,
        case.grasp,
        theta=theta,
        alpha=alpha,
        repeats=repeats,
        noise=noise,
        rng=np.random.default_rng(seed),
        channels=channels,
        state_sd=bool(noise > 0),
    )


def without_sd(table: PeakTable) -> PeakTable:
    """The same heights, nothing said of their noise."""
    names = [f"{channel}_sd_{table.unit}" for channel in table.channels]
    return PeakTable.from_frame(table.frame.drop(columns=names, errors="ignore"))


def tables_of_the_prior(n: int) -> tuple[PeakTable, ...]:
    """One sweep of 17 elevations, thrice, pushed on grasps drawn from the prior."""
    fitted = fit_table(case_table(CASES["firm"], noise=0.03), config())
    return simulate_tables(fitted, n, np.random.default_rng(0)).tables


def one_sided_table() -> PeakTable:
    """θ_c = 72° and no push above 60°, seen by a sensor of both components."""
    return case_table(
        CASES["one_sided"],
        noise=0.03,
        theta_deg=LOW_DEG,
        channels=("height_normal", "height_tangential"),
    )


def setup_of(table: PeakTable, text: str = "") -> Setup:
    """The problem that a table poses."""
    return settle_noise(build_problem(table, config(text)))


def log_contact(params: Parameters) -> dict[str, float]:
    """ln A, ln B and ln C_rr by the printed formulas."""
    p = {n: float(getattr(params, n)) for n in ("K_sn", "K_dn", "K_st", "C_d", "L")}
    return {
        "ln_A": np.log(p["K_sn"] * p["K_dn"] / (p["K_sn"] + p["K_dn"])),
        "ln_B": np.log(p["K_st"] * p["C_d"] / (p["L"] ** 2 * p["K_st"] + p["C_d"])),
        "ln_C_rr": np.log(float(params.C_rr)),
    }
