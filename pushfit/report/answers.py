"""What may be said of θ_c and α*: the words, the values to mark and the sentence.

Text, page and figures take the two answers from here, so they cannot disagree. The
rule beside those of `pushfit.fit.assess.reporting_rules`: all pieces of a set, never
their hull. Excluded: all else that reports state (`pushfit.report.fact_rows`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from pushfit.errors import counted
from pushfit.fit.assess.model_free import ROLLED
from pushfit.fit.assess.reporting_rules import Pieces, is_trusted, pieces_for
from pushfit.fit.results import FitStatus, Identification, Piece, Quantity, Verdict
from pushfit.mechanics.registry import mechanics_named
from pushfit.parameters import HALF_TURN
from pushfit.report.strings import (
    format_angle,
    format_estimate,
    format_range,
    join_or,
    printable,
)

# Fewer different angles than this leave the question open, and are no sweep to draw: a
# line through two shows nothing.
MIN_DIRECTIONS = 3
# Below this share of draws without a critical angle nothing is said about them.
MIN_SHARE = 0.01
# An estimate this close to the end of the reach is the end of the reach [deg].
REACH_TOLERANCE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerText:
    """One angle, ready to be printed and drawn.

    Args:
        name: "theta_c" or "alpha_star".
        short: The answer in a few words, without the symbol.
        sentence: The answer in one plain sentence, remarks behind it.
        values: Values to mark [deg]; none where nothing may be quoted.
        pieces: Set to shade [deg].
    """

    name: str
    short: str
    sentence: str
    values: tuple[float, ...] = ()
    pieces: Pieces = ()


def theta_c_answer(identification: Identification) -> AnswerText:
    """What may be said of the critical angle."""
    quantity = identification.theta_c
    subject = _theta_c_subject(identification)
    if not is_trusted(identification):
        return _unquoted("theta_c", subject, identification)
    answer = _angle_answer(identification, quantity, subject)
    draws = _draws(identification, "theta_c")
    none_share = float(np.mean(np.isnan(draws))) if draws.size else 0.0
    if none_share >= MIN_SHARE and answer.values:
        more = (
            f"With probability {100 * none_share:.0f} % it does not exist: "
            "the contact never rolls."
        )
        answer = _with_remarks(answer, [more])
    return _with_caution(answer, identification)


def alpha_star_answer(identification: Identification) -> AnswerText:
    """What may be said of the best push direction."""
    quantity = identification.alpha_star
    subject, reach = "The best push direction α*", identification.config.reach
    if not is_trusted(identification):
        answer = _unquoted("alpha_star", subject, identification)
        return _with_remarks(answer, [_model_free_remark(identification)])
    answer = _angle_answer(identification, quantity, subject)
    remarks = [_reach_remark(answer, reach.alpha_deg)]
    if quantity.estimate is not None:
        remarks.append(_model_free_remark(identification))
    return _with_caution(_with_remarks(answer, remarks), identification)


def _draws(identification: Identification, name: str) -> Float[np.ndarray, " n"]:
    return np.asarray(identification.posterior.samples.get(name, np.empty(0)))


def _theta_c_subject(identification: Identification) -> str:
    """The critical angle with the circumstances that it depends on."""
    config, circumstances = identification.config, []
    if mechanics_named(identification.mechanics).has_length:
        circumstances.append(f"of {config.push.length_mm:g} mm")
    if np.unique(identification.table.alpha).size > 1:
        circumstances.append(f"at α = {identification.reference_alpha_deg:g}°")
    words = ["for pushes", *circumstances] if circumstances else []
    return " ".join(["The critical angle θ_c", *words])


def _angle_answer(
    identification: Identification, quantity: Quantity, subject: str
) -> AnswerText:
    """Answer by the verdict of a quantity whose numerics are trusted."""
    prob = f"{100 * quantity.prob:g} %"
    verdict, estimate = quantity.verdict, quantity.estimate
    pieces, is_axis = pieces_for(quantity), identification.config.reach.is_whole
    ranges = join_or([format_range(*p, "deg", is_axis=is_axis) for p in pieces])
    if verdict is Verdict.SEVERAL_MODES and len(pieces) > 1:
        draws = _draws(identification, quantity.name)
        values = tuple(_typical(piece, draws) for piece in pieces)
        spread = 10 * min(_width(piece) for piece in pieces)
        short = join_or([format_angle(value, spread=spread) for value in values])
        which = "both fit" if len(values) == 2 else "all fit"
        sentence = f"{subject} is {short} ({prob} set: {ranges}); {which} the data."
    elif verdict is Verdict.ONE_SIDED and pieces:
        values, short = (), ranges
        sentence = f"{subject} is {ranges} ({prob}); the data bound it no further."
    elif verdict is Verdict.WIDE and quantity.interval is not None:
        values, pieces = (), (quantity.interval,)
        short = format_range(*quantity.interval, "deg", is_axis=is_axis)
        sentence = (
            f"{subject} is {short} ({prob} interval), which is wider than was wanted."
        )
    elif verdict is Verdict.ABSENT:
        values, short = (), "does not exist"
        sentence = f"{subject} {short}: this contact never rolls."
        before = identification.posterior.prior_samples.get(quantity.name, np.empty(0))
        if before.size and np.mean(np.isnan(before)) >= quantity.prob:
            sentence += " That is known without the heights, from settings and priors."
    elif estimate is None or verdict is Verdict.ASSUMED:
        values, pieces, short = (), (), "not determined by these data"
        sentence = f"{subject} is {short}: {_reason(identification, quantity)}."
    elif quantity.interval is None:
        values, short = (estimate,), format_angle(estimate)
        is_fixed = verdict is Verdict.FIXED
        sentence = f"{subject} is {short}{', as configured' if is_fixed else ''}."
        if verdict is Verdict.PROVISIONAL:
            # What comes before says that the model does not fit.
            sentence = f"{subject} would be {short} if it did; no interval holds."
            short = f"{short}, provisional"
    else:
        values, pieces = (estimate,), (quantity.interval,)  # drawn as it is said
        number, interval = format_estimate(
            estimate, quantity.interval, "deg", is_axis=is_axis
        )
        short = f"{number} ({interval})"
        sentence = f"{subject} is {number} ({prob} interval: {interval})."
    return AnswerText(
        name=quantity.name, values=values, pieces=pieces, short=short, sentence=sentence
    )


ANSWERS = {"theta_c": theta_c_answer, "alpha_star": alpha_star_answer}


def _reason(identification: Identification, quantity: Quantity) -> str:
    """Why an angle is not determined."""
    if quantity.verdict is Verdict.PROVISIONAL:
        return "the model does not describe them"
    if quantity.note:
        return printable(quantity.note).rstrip(".")
    angles, few = identification.table.theta, "elevation"
    many = "the heights fit every critical angle about equally well"
    if quantity.name == "alpha_star":
        angles, few = identification.table.alpha, "azimuth"
        where = _where_it_rolls(identification)
        many = f"the heights show no preferred direction{where}"
    n_different = np.unique(angles[identification.used].round(6)).size
    if n_different < MIN_DIRECTIONS:
        only = counted(n_different, few)
        return f"the pushes have only {only}, and at least {MIN_DIRECTIONS} are needed"
    profile = identification.profiles.get(quantity.name)
    if profile is not None and profile.degrees_of_freedom < 1:
        return (
            "as many unknowns as heights leave nothing to tell the noise by; push more "
            "directions, or each of them twice"
        )
    return many


def _where_it_rolls(identification: Identification) -> str:
    """What to add where azimuths were swept below θ_c only: all are alike there."""
    table, rows = identification.table, identification.used
    theta_c = identification.theta_c.estimate
    theta = np.degrees(table.theta[rows]).round(6)
    alpha = table.alpha[rows].round(6)
    n_azimuths = {level: np.unique(alpha[theta == level]).size for level in theta}
    swept = [level for level, n in n_azimuths.items() if n >= MIN_DIRECTIONS]
    if theta_c is None or not swept or max(swept) >= theta_c:
        return ""
    return (
        f" at θ = {max(swept):g}°, which is below θ_c, where the contact rolls "
        "whatever the azimuth; sweep the azimuth above θ_c"
    )


def _typical(piece: Piece, draws: Float[np.ndarray, " n"]) -> float:
    """Median of the draws in a piece, its middle or its only end without draws."""
    low = -np.inf if piece[0] is None else piece[0]
    high = np.inf if piece[1] is None else piece[1]
    # A piece across the seam of an axis holds draws from just above 0 as well.
    is_across = np.max(draws, initial=0.0) < HALF_TURN < high < np.inf
    turned = np.where(is_across & (draws < low), draws + HALF_TURN, draws)
    inside = turned[(turned >= low) & (turned <= high)]
    ends = [end for end in piece if end is not None]
    middle = float(np.median(inside) if inside.size else np.mean(ends))
    return middle % HALF_TURN if is_across else middle


def _width(piece: Piece) -> float:
    """Width of a piece; a right angle where it is open."""
    low, high = piece
    return 90.0 if low is None or high is None else high - low


def _reach_remark(answer: AnswerText, reach: tuple[float, float]) -> str:
    """What to add where the best direction is the last one that can be reached."""
    if len(answer.values) != 1 or reach[1] - reach[0] >= HALF_TURN:
        return ""
    distance = min(abs(answer.values[0] - end) for end in reach)
    if distance > REACH_TOLERANCE:
        return ""
    return "It is the end of the reach; resistance may fall further beyond."


def _model_free_remark(identification: Identification) -> str:
    """What a cosine through the heights alone gives, and whether that is the same."""
    quantity, reach = identification.alpha_star, identification.config.reach
    free = identification.alpha_star_model_free
    if free is None or free.estimate is None:
        return ""
    said = "A cosine through the heights alone"
    is_bare = quantity.estimate is not None and quantity.interval is None
    if free.interval is None or is_bare:
        return f"{said} gives {format_angle(free.estimate)}."
    low, high = free.interval
    spread = high - low
    number = format_angle(free.estimate, spread=spread)
    number += f" ({format_range(low, high, 'deg', is_axis=reach.is_whole)})"
    if quantity.estimate is None or quantity.interval is None:
        return f"{said} gives {number}."
    gap = abs(free.estimate - quantity.estimate) % HALF_TURN
    gap = min(gap, HALF_TURN - gap)
    # Half the sum of the widths: the intervals just touch.
    touching = (spread + quantity.interval[1] - quantity.interval[0]) / 2
    word = "agrees" if gap <= touching else "disagrees"
    if any(warning.code == ROLLED for warning in identification.warnings):
        word = "differs, as pushes that roll meet most resistance along α*"
    return f"{said} {word}: {number}."


def _with_remarks(answer: AnswerText, remarks: list[str]) -> AnswerText:
    return replace(answer, sentence=" ".join([answer.sentence, *filter(None, remarks)]))


def _with_caution(answer: AnswerText, identification: Identification) -> AnswerText:
    """Answer that says first if the model does not describe the data as they are."""
    if identification.goodness_of_fit.is_adequate:
        return answer
    sentence = answer.sentence[0].lower() + answer.sentence[1:]
    return replace(
        answer,
        sentence=f"Not to be relied on, because the model does not fit this "
        f"table as it is: {sentence}",
    )


def _unquoted(name: str, subject: str, identification: Identification) -> AnswerText:
    status = identification.status
    if status is FitStatus.OK:
        status = identification.posterior.status
    return AnswerText(
        name=name,
        short=f"not quoted ({status.name.lower().replace('_', ' ')})",
        sentence=f"{subject} is not quoted: {status.value}.",
    )
