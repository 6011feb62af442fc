"""Likelihood sets of the six parameters, from those of A and B.

Heights know the parameters only through A, B and C_rr. With all partners fixed a
parameter is a function of A or B; with one partner free it is bounded on one side, for
example K_sn > A; with more free it is not bounded at all. Excluded: priors, which are
the only other source of knowledge about the six.
"""

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float

from pushfit.fit.problem.problem import Problem
from pushfit.fit.profiles.profile_sets import pieces_below, threshold, verdict_of
from pushfit.fit.results import LikelihoodProfile
from pushfit.parameters import TINY, unit_of

Map = Callable[[Float[np.ndarray, " g"]], Float[np.ndarray, " g"]]


def implied_profiles(
    problem: Problem,
    profiles: Mapping[str, LikelihoodProfile],
    *,
    newton: str,
) -> dict[str, LikelihoodProfile]:
    """Profiles of the free parameters among the six, C_rr excepted.

    With an ellipse the relations hold for the geometric means up to second order in
    the ratio of its axes.

    Args:
        problem: Problem; says which parameters are fixed.
        profiles: Profiles of A and B, as far as the data meet them.

    Returns:
        Profiles by name, on an empty grid for parameters that the data do not bound.
    """
    fixed = {name: float(value) for name, value in problem.fixed.items()}
    relations = [
        (name, "A", _partner_of_series(fixed.get(partner)), partner not in fixed)
        for name, partner in (("K_sn", "K_dn"), ("K_dn", "K_sn"))
        if name not in fixed
    ]
    relations += [(name, "B", *how) for name, how in _tangential(fixed).items()]
    return {
        name: _mapped(name, profiles[of], map_, is_bound, unit_of(name, newton))
        for name, of, map_, is_bound in relations
        if of in profiles
    }


def _partner_of_series(other: float | None) -> Map:
    """One spring of a series from the whole: 1/(1/A - 1/other), or A as its bound."""
    if other is None:
        return lambda whole: whole
    return lambda whole: np.where(
        whole < other, whole / np.maximum(1 - whole / other, TINY), np.nan
    )


def _tangential(fixed: Mapping[str, float]) -> dict[str, tuple[Map | None, bool]]:
    """How each free one of K_st, C_d and L follows from B, and if only as a bound.

    C_d/L² is the spring in series with K_st: 1/B = 1/K_st + L²/C_d.
    """
    K_st, C_d, L = (fixed.get(name) for name in ("K_st", "C_d", "L"))
    rotation = None if C_d is None or L is None else C_d / L**2
    rotational = _partner_of_series(K_st)
    found: dict[str, tuple[Map | None, bool]] = {}
    if K_st is None:
        found["K_st"] = (_partner_of_series(rotation), rotation is None)
    if C_d is None:
        map_ = None if L is None else lambda B: rotational(B) * L**2
        found["C_d"] = (map_, K_st is None)
    if L is None:
        map_ = None if C_d is None else lambda B: np.sqrt(C_d / rotational(B))
        found["L"] = (map_, K_st is None)
    return found


def _mapped(
    name: str,
    source: LikelihoodProfile,
    map_: Map | None,
    is_bound: bool,
    unit: str,
) -> LikelihoodProfile:
    """Profile of a monotone function of the source, or of what it bounds.

    Where the source only bounds the parameter, every value beyond a possible bound is
    as likely as that bound: the profile is the least of the source on the near side.
    """
    values, delta, pieces = np.zeros(0), np.zeros(0), ((None, None),)
    if map_ is not None:
        values = map_(source.values)
        is_possible = np.isfinite(values)
        values, delta = values[is_possible], source.delta_chi_square[is_possible]
    if values.size:
        if is_bound:
            # Rising: K_sn > A. Falling: L < sqrt(C_d / B), for any B as small or less.
            delta = np.minimum.accumulate(delta)
        if values[-1] < values[0]:
            values, delta = values[::-1], delta[::-1]
        delta = delta - np.min(delta)
        level = threshold(source.prob, source.degrees_of_freedom)
        pieces = pieces_below(values, delta, level)
    return LikelihoodProfile(
        name=name,
        unit=unit,
        values=values,
        delta_chi_square=delta,
        pieces=pieces,
        prob=source.prob,
        verdict=verdict_of(pieces),
        degrees_of_freedom=source.degrees_of_freedom,
    )
