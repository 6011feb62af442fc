"""Two results side by side: what differs, by how much, and how surely.

Both posteriors are taken as independent, so the draws of one are subtracted from those
of the other. Excluded: two models of the same pushes, which `compare` weighs.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pushfit.errors import DataError
from pushfit.fit.assess.reporting_rules import is_trusted
from pushfit.fit.results import Identification, Quantity, Verdict
from pushfit.mechanics.registry import mechanics_named
from pushfit.parameters import HALF_TURN
from pushfit.report.fact_rows import UNQUOTED, is_withheld, quantity_cells, verdict_word
from pushfit.report.json_values import Json, json_safe
from pushfit.report.strings import (
    format_number,
    join_and,
    printable,
    symbol,
    unit_label,
    with_unit,
)

SCHEMA = "pushfit.difference/1"
# Beyond this share of draws without a critical angle the rest says too little.
MAX_NONE = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How much larger a quantity is in the second result.

    Args:
        name: Stable name, as in `summary.json`.
        unit: Unit of every number below.
        first: What the first result says of it.
        second: What the second says.
        estimate: Median of second - first; of an axis the shorter way round.
        interval: Equal-tailed interval of it.
        prob: Probability of the interval.
        prob_larger: Probability that the second is larger.
    """

    name: str
    unit: str
    first: Quantity
    second: Quantity
    estimate: float
    interval: tuple[float, float]
    prob: float
    prob_larger: float

    @property
    def is_clear(self) -> bool:
        """Whether the interval leaves out zero."""
        return self.interval[0] > 0 or self.interval[1] < 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultDifferences:
    """Two results.

    Args:
        differences: One for each quantity that both determine.
        left_out: Sentences on what could not be compared.
        notes: Sentences on what else differs.
    """

    differences: tuple[Difference, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...]


def compare_results(first: Identification, second: Identification) -> ResultDifferences:
    """Subtract angles, combinations and parameters of two results.

    Raises:
        DataError: One of them is not to be trusted (`untrusted_result`), or both are of
            the same pushes (`same_inputs`).
    """
    for result in (first, second):
        if not is_trusted(result):
            raise DataError(
                "a result whose numerics are not to be trusted cannot be compared: "
                f"{result.status.value}; identify it again as its warnings say",
                code="untrusted_result",
            )
    digests = {source.sha256 for source in first.table.sources}
    shared = [s.path for s in second.table.sources if s.sha256 in digests]
    # A table made in memory, such as that of an exploration, has no file.
    is_same = not digests and first.table.frame.equals(second.table.frame)
    if shared or is_same:
        rows = join_and(shared) or "equal rows"
        raise DataError(
            f"both results are made of {rows}, so they are not "
            "independent; compare results of different pushes, and models of the same "
            "pushes by `pushfit compare`",
            code="same_inputs",
        )
    named = {quantity.name: quantity for quantity in _quantities(second)}
    found, left_out = [], []
    for ours in _quantities(first):
        theirs, reason = named.get(ours.name), "the second result does not have it"
        if theirs is not None:
            reason = _why_not(ours, theirs, first, second)
        if theirs is None or reason:
            left_out.append(f"{symbol(ours.name)}, because {reason}")
        else:
            found.append(_difference(ours, theirs, first, second))
    one, other = (mechanics_named(r.mechanics).title for r in (first, second))
    note = f"the first is by {one}, the second by {other}, which differ, too"
    return ResultDifferences(
        differences=tuple(found),
        left_out=tuple(left_out),
        notes=() if one == other else (note,),
    )


def _quantities(result: Identification) -> tuple[Quantity, ...]:
    angles = (result.theta_c, result.alpha_star)
    return (*angles, *result.combinations, *result.parameters)


def _why_not(
    ours: Quantity, theirs: Quantity, first: Identification, second: Identification
) -> str:
    """Why a quantity cannot be compared; empty if it can."""
    for which, quantity in (("first", ours), ("second", theirs)):
        if quantity.verdict is Verdict.ASSUMED:
            return f"the {which} result has it from the prior alone"
        if quantity.estimate is None or quantity.interval is None:
            return f"in the {which} result it is {_unquoted(quantity)}"
    units = {unit_label(quantity.unit) for quantity in (ours, theirs)}
    if len(units) > 1:
        return f"one result has it in {' and the other in '.join(sorted(units))}"
    azimuths = {result.reference_alpha_deg for result in (first, second)}
    if ours.name == "theta_c" and len(azimuths) > 1:
        at = " and ".join(f"{azimuth:g}°" for azimuth in sorted(azimuths))
        return f"it belongs to α = {at}; state grasp.reference_alpha_deg"
    draws = [result.posterior.samples.get(ours.name) for result in (first, second)]
    if any(d is None or np.mean(np.isnan(d)) > MAX_NONE for d in draws):
        return "it does not exist in a good part of the draws"
    return ""


def _unquoted(quantity: Quantity) -> str:
    """Why a quantity has no interval, in a few words."""
    if quantity.note.startswith(UNQUOTED):
        return printable(quantity.note)
    return UNQUOTED if is_withheld(quantity) else verdict_word(quantity.verdict)


def _difference(
    ours: Quantity, theirs: Quantity, first: Identification, second: Identification
) -> Difference:
    draws = [result.posterior.samples[ours.name] for result in (first, second)]
    change = subtracted(*draws, is_axis=ours.name == "alpha_star")
    tail = (1 - ours.prob) / 2
    low, middle, high = np.quantile(change, [tail, 0.5, 1 - tail])
    return Difference(
        name=ours.name,
        unit=ours.unit,
        first=ours,
        second=theirs,
        estimate=float(middle),
        interval=(float(low), float(high)),
        prob=ours.prob,
        prob_larger=float(np.mean(change > 0)),
    )


def subtracted(
    first: Float[np.ndarray, " n"], second: Float[np.ndarray, " m"], *, is_axis: bool
) -> Float[np.ndarray, " k"]:
    """Draws of second - first, of independent posteriors.

    Args:
        first: Draws of one; NaN where it does not exist.
        is_axis: Whether 180° is 0°; then the shorter way round [deg].
    """
    ours, theirs = (draws[np.isfinite(draws)] for draws in (first, second))
    # Any pairing is as good as any other, unless both are sorted.
    rng = np.random.default_rng(0)
    n = min(ours.size, theirs.size)
    change = rng.permutation(theirs)[:n] - rng.permutation(ours)[:n]
    if is_axis:
        change = (change + HALF_TURN / 2) % HALF_TURN - HALF_TURN / 2
    return change


def difference_text(comparison: ResultDifferences) -> str:
    """What differs, in words and numbers."""
    lines = []
    for one in comparison.differences:
        first, second = (_in_short(q) for q in (one.first, one.second))
        lines.append(f"{symbol(one.name)}: {first}, then {second}")
        lines.append(f"    {sentence(one)}")
    lines += [f"not compared: {text}" for text in comparison.left_out]
    lines += comparison.notes
    return "\n".join(lines)


def sentence(difference: Difference) -> str:
    """The verdict on one difference."""
    low, high = difference.interval
    spread = high - low
    size = with_unit(
        format_number(abs(difference.estimate), spread=spread), difference.unit
    )
    word = "larger" if difference.estimate > 0 else "smaller"
    surely = max(difference.prob_larger, 1 - difference.prob_larger)
    chance = "over 99.9 %" if surely > 0.999 else f"{100 * surely:.3g} %"
    ends = " to ".join(format_number(end, spread=spread) for end in (low, high))
    change = with_unit(ends, difference.unit)
    said = (
        f"the second is {size} {word} ({100 * difference.prob:g} %: {change}; {chance})"
    )
    return said if difference.is_clear else f"no clear difference; {said}"


def _in_short(quantity: Quantity) -> str:
    value, interval, _, _, _ = quantity_cells(quantity)
    return f"{with_unit(value, quantity.unit)} ({interval})"


def difference_dict(comparison: ResultDifferences) -> dict[str, Json]:
    """Differences as a document that programs read."""
    content = {
        one.name: {
            "unit": one.unit,
            "first": _numbers(one.first),
            "second": _numbers(one.second),
            "difference": _numbers(one),
            "prob": one.prob,
            "prob_larger": one.prob_larger,
            "is_clear": one.is_clear,
        }
        for one in comparison.differences
    }
    return {
        "schema": SCHEMA,
        "status": "ok",
        "differences": json_safe(content),
        "left_out": json_safe(comparison.left_out),
        "notes": json_safe(comparison.notes),
    }


def _numbers(one: Quantity | Difference) -> dict[str, object]:
    return {"estimate": one.estimate, "interval": one.interval}
