"""Which measurement would tell more: one sentence each.

Excluded: the next push (`pushfit.explore.advice`).
"""

from collections.abc import Mapping

from pushfit.fit.problem.problem import Problem
from pushfit.fit.results import Verdict


def measurements(
    problem: Problem,
    *,
    verdicts: Mapping[str, Verdict],
    is_calibrated: bool,
    has_direction: bool,
    is_ordered: bool,
) -> tuple[str, ...]:
    """What other measurements would determine, the most useful first.

    Args:
        is_calibrated: Whether heights convert to newtons.
        has_direction: Whether several azimuths were pushed.
        is_ordered: Whether elevations were pushed in order, and never again.
    """
    free = set(problem.priors)
    sentences = []
    if not has_direction:
        sentences.append(
            "All pushes share one azimuth, so α* was not asked; push in at least three "
            "azimuths at one elevation."
        )
    if is_ordered:
        sentences.append(
            "The elevations were pushed in order and none of them again later, so a "
            "drift of grip or sensor would look like an effect of θ; push some of them "
            "again at the end, or all in random order."
        )
    unclear = verdicts.get("theta_c") is not Verdict.DETERMINED
    if unclear and problem.channels == ("height",):
        sentences.append(
            "A magnitude sees the tangential force only in quadrature; normal and "
            "tangential components (height_normal, height_tangential) determine θ_c "
            "far better."
        )
    if {"K_sn", "K_dn"} <= free:
        sentences.append(
            "The data fix A = K_sn K_dn/(K_sn + K_dn) only; with K_sn from the finger "
            "controller, K_dn = A K_sn/(K_sn - A) follows."
        )
    tangential = {"K_st", "C_d", "L"} & free
    if len(tangential) > 1:
        # Where the object tilts, forces tell K_st and C_d apart, if hardly.
        extent = "best" if problem.grasp.law.sees_tilt else "only"
        sentences.append(
            f"The data fix B = K_st C_d/(L² K_st + C_d) {extent}; with L by callipers "
            "and K_st from the finger controller, C_d follows."
        )
    if not is_calibrated:
        sentences.append(
            "A calibrated sensor ([sensor] counts_per_n, n_per_kpa, ...) would give "
            "stiffness in N/m; θ_c, α* and C_rr need no calibration."
        )
    return tuple(sentences)
