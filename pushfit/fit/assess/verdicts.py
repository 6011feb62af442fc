"""What is known of each quantity: its draws and its profile, with a verdict.

An end that the likelihood leaves open is open in every set of an angle. The word for
the shape of a set is that of `pushfit.fit.profiles.profile_sets`. Excluded: which of
these numbers may be quoted (`reporting_rules`).
"""

import functools
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from pushfit.fit.problem.derived import (
    contraction,
    equal_tailed_interval,
    highest_density_set,
    median,
)
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.profile_sets import verdict_of
from pushfit.fit.results import (
    LikelihoodProfile,
    Piece,
    PosteriorResult,
    Quantity,
    Verdict,
)
from pushfit.parameters import (
    COMBINATIONS,
    OF_GRASP,
    POSITIVE,
    SIGNED,
    SIX,
    STIFFNESSES,
    unit_of,
)

# Contraction above the first is learned from the data, below the second assumed: the
# data then shrink the prior's standard deviation by less than a tenth.
LEARNED, ASSUMED = 0.8, 0.2
# What is said of A and B, in the words of their profiles, where draws alone are known.
WITHOUT_PROFILE = {
    Verdict.LEARNED: Verdict.DETERMINED,
    Verdict.PARTLY: Verdict.WIDE,
    Verdict.ASSUMED: Verdict.NOT_DETERMINED,
}
FORMULAS = {
    "A": "K_sn K_dn/(K_sn + K_dn)",
    "B": "K_st C_d/(L² K_st + C_d)",
    "f1": "log ratio of the axes of B, part along x",
    "f2": "log ratio of the axes of B, part at 45°",
}
LOG_QUANTITIES = ("A", "B", *POSITIVE)


def angle_quantity(
    name: str,
    posterior: PosteriorResult,
    profile: LikelihoodProfile | None,
    *,
    prob: float,
    is_axis: bool = False,
    by_draws: bool = False,
) -> Quantity:
    """θ_c or α*, as far as the data determine it.

    Args:
        name: "theta_c" or "alpha_star".
        profile: Likelihood profile; None where the question was not asked.
        is_axis: Whether it is an azimuth of period 180°, all of which are reached.
        by_draws: Whether there is no profile to be had, as of the best direction on two
            supports: then the draws alone tell.

    Returns:
        The quantity, without numbers where a good part of the draws has no such angle.
        Where the data hardly narrow the prior nothing is determined, however sharp the
        profile: a few pushes can be fitted perfectly by a model that knows nothing.
        ABSENT where the draws without such an angle are `prob` of them or more.
    """
    verdict = Verdict.NOT_DETERMINED if profile is None else profile.verdict
    likelihood_sets = () if profile is None else profile.pieces
    draws = posterior.samples.get(name)
    sets, interval, estimate, note = (), None, None, ""
    if draws is not None:
        has_ends = name == "alpha_star" and not is_axis
        found = highest_density_set(draws, prob, is_axis=is_axis, has_ends=has_ends)
        before = _set_before(
            posterior.prior_samples[name].tobytes(), prob, is_axis, has_ends
        )
        if by_draws and _is_open(before):
            verdict = verdict_of(found)
        if _is_open(before) and not _is_narrowed(found, before):
            verdict = Verdict.NOT_DETERMINED
        never = float(np.mean(np.isnan(draws)))
        if never >= prob:
            # Its likelihood compares contacts that roll with each other.
            verdict, likelihood_sets = Verdict.ABSENT, ()
        # Draws without a critical angle are no part of any interval for it.
        if never < (1 - prob) / 2:
            sets = _with_open_ends(found, likelihood_sets)
            ordered = posterior.ordered[name]
            interval = equal_tailed_interval(ordered, prob, is_axis=is_axis)
            estimate = median(ordered, is_axis=is_axis)
        else:
            note = f"{never:.1%} of the posterior never rolls"
    return Quantity(
        name=name,
        unit="deg",
        estimate=estimate,
        interval=interval,
        prob=prob,
        sets=sets,
        likelihood_sets=likelihood_sets,
        verdict=verdict,
        contraction=_contraction(name, posterior),
        note=note,
    )


def quantities(
    setup: Setup,
    posterior: PosteriorResult,
    profiles: Mapping[str, LikelihoodProfile],
    *,
    prob: float,
    unit: str,
    with_sets: bool = True,
) -> tuple[tuple[Quantity, ...], tuple[Quantity, ...]]:
    """The parameters with what the data added to their priors, and combinations.

    Args:
        with_sets: Whether to look for highest-density sets, the slowest part.

    Returns:
        The six parameters, e1, e2, F_0, p and sigmas, as far as they exist; A, B and
        the shape of B, what linear forces depend on beside C_rr.
    """
    newton = "N" if setup.is_calibrated else unit

    def one(name: str) -> Quantity:
        draws, profile = posterior.ordered[name], profiles.get(name)
        is_noise, prior = name.startswith("sigma_"), setup.problem.priors.get(name)
        share = _contraction(name, posterior)
        verdict = _parameter_verdict(share, is_fixed=name in setup.problem.fixed)
        note = FORMULAS.get(name) or ("fixed" if prior is None else prior.describe())
        if name in COMBINATIONS and profile:
            verdict = profile.verdict
        elif name in STIFFNESSES & COMBINATIONS.keys() and np.ptp(draws) > 0:
            verdict = WITHOUT_PROFILE.get(verdict, verdict)
        elif (
            verdict is Verdict.LEARNED
            and profile
            and any(None in p for p in profile.pieces)
        ):
            # An end that no height bounds is that of the prior.
            verdict = Verdict.PARTLY
        return Quantity(
            name=name,
            unit=unit if is_noise else unit_of(name, newton),
            estimate=median(draws),
            interval=equal_tailed_interval(draws, prob),
            prob=prob,
            sets=highest_density_set(draws, prob) if with_sets else (),
            likelihood_sets=() if profile is None else profile.pieces,
            verdict=verdict,
            contraction=share,
            note=note,
        )

    names = [n for n in (*SIX, *SIGNED, *OF_GRASP) if n in posterior.samples]
    names += [n for n in posterior.samples if n.startswith("sigma_")]
    combinations = [name for name in COMBINATIONS if name in posterior.samples]
    return tuple(map(one, names)), tuple(map(one, combinations))


def _parameter_verdict(share: float | None, *, is_fixed: bool) -> Verdict:
    """Learned, partly or assumed, by how far the data shrink the prior."""
    if is_fixed:
        return Verdict.FIXED
    if share is None or share < ASSUMED:
        return Verdict.ASSUMED
    return Verdict.LEARNED if share >= LEARNED else Verdict.PARTLY


def _contraction(name: str, posterior: PosteriorResult) -> float | None:
    """1 - var_posterior / var_prior on the prior's own scale."""
    draws, before = posterior.samples.get(name), posterior.prior_samples.get(name)
    if draws is None or before is None or name == "alpha_star":
        return None
    if name in LOG_QUANTITIES or name.startswith("sigma_"):
        draws, before = np.log(draws), np.log(before)
    draws, before = _finite(draws), _finite(before)
    if draws.size == 0 or before.size == 0 or np.var(before) == 0:
        return None
    return contraction(draws, before)


@functools.lru_cache(maxsize=256)
def _set_before(
    draws: bytes, prob: float, is_axis: bool, has_ends: bool
) -> tuple[Piece, ...]:
    """The prior's set of an angle; many tables share their prior's draws."""
    values = np.frombuffer(draws, dtype=float)
    return highest_density_set(values, prob, is_axis=is_axis, has_ends=has_ends)


def _is_open(before: tuple[Piece, ...]) -> bool:
    """Whether the prior leaves more than one value."""
    return len(before) > 1 or _width(before) > 0


def _is_narrowed(found: tuple[Piece, ...], before: tuple[Piece, ...]) -> bool:
    """Whether the data make a set that is open much smaller."""
    width = _width(before)
    if width > 0:
        return 1 - _width(found) / width >= ASSUMED
    # Both ends of a short reach, and no width between them.
    return len(found) < len(before)


def _width(pieces: tuple[Piece, ...]) -> float:
    closed = [(a, b) for a, b in pieces if a is not None and b is not None]
    return sum((high - low for low, high in closed), 0.0)


def _finite(values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    return values[np.isfinite(values)]


def _with_open_ends(
    sets: tuple[Piece, ...], likelihood_sets: tuple[Piece, ...]
) -> tuple[Piece, ...]:
    """Posterior pieces whose outer ends are open where the likelihood's are."""
    if not sets or not likelihood_sets:
        return sets
    pieces = [list(piece) for piece in sets]
    if likelihood_sets[0][0] is None:
        pieces[0][0] = None
    if likelihood_sets[-1][1] is None:
        pieces[-1][1] = None
    return tuple((low, high) for low, high in pieces)
