"""Results as tables: parameters for a notebook, correlations for the reports.

Excluded: the rows of a page (`pushfit.report.html.card`).
"""

import itertools
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pushfit.fit.assess.reporting_rules import is_trusted
from pushfit.fit.results import Identification, Verdict
from pushfit.parameters import STIFFNESSES

# Weaker correlations change no reading of the intervals.
MIN_CORRELATION = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Correlation of two quantities over the posterior draws.

    Args:
        first: Name of one.
        second: Name of the other.
        value: Pearson's, of the logs where both are positive [-].
    """

    first: str
    second: str
    value: float


def result_frame(identification: Identification) -> pd.DataFrame:
    """Angles, parameters and combinations, with the columns of `Result.to_frame`."""
    kinds = (
        ("angle", (identification.theta_c, identification.alpha_star)),
        ("parameter", identification.parameters),
        ("combination", identification.combinations),
    )
    rows = []
    for kind, quantities in kinds:
        for quantity in quantities:
            lower, upper = quantity.interval or (np.nan, np.nan)
            rows.append(
                {
                    "name": quantity.name,
                    "kind": kind,
                    "estimate": quantity.estimate,
                    "lower": lower,
                    "upper": upper,
                    "prob": quantity.prob,
                    "unit": quantity.unit,
                    "verdict": quantity.verdict.value,
                    "contraction": quantity.contraction,
                    "note": quantity.note,
                }
            )
    numbers = ("estimate", "lower", "upper", "prob", "contraction")
    frame = pd.DataFrame(rows).set_index("name")
    return frame.astype(dict.fromkeys(numbers, float))


def correlations(identification: Identification) -> tuple[Correlation, ...]:
    """Strong correlations among the parameters, and among the combinations.

    A combination is a function of the parameters, so pairs across the two groups say
    nothing and are left out.

    Returns:
        Strongest first; none from a posterior that is not to be trusted.
    """
    if not is_trusted(identification):
        return ()
    found = []
    for group in (identification.parameters, identification.combinations):
        names = [q.name for q in group if q.verdict is not Verdict.FIXED]
        if not identification.config.push.length_known:
            names = [name for name in names if name not in STIFFNESSES]
        scaled = {}
        for name in names:
            draws = identification.posterior.samples.get(name)
            if draws is not None and np.isfinite(draws).all() and np.ptp(draws) > 0:
                scaled[name] = np.log(draws) if np.all(draws > 0) else draws
        for first, second in itertools.combinations(scaled, 2):
            value = float(np.corrcoef(scaled[first], scaled[second])[0, 1])
            if abs(value) >= MIN_CORRELATION:
                found.append(Correlation(first=first, second=second, value=value))
    return tuple(sorted(found, key=lambda c: -abs(c.value)))
