"""An exploration for people and scripts: sentences, and a document.

Excluded: its picture (`pushfit.report.figures.exploration`).
"""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from pushfit.explore.explorer import Explorer
from pushfit.explore.records import Answer, State, Suggestion
from pushfit.fit.results import ResultWarning
from pushfit.parameters import ANGLES
from pushfit.report.json_values import json_safe

SCHEMA = "pushfit.next/1"
# Likelihood sets that are looked at until they are narrow cover less than they state:
# `python -m benchmarks.explore.answers --channels height --control` says by how much.
ADAPTIVE = ResultWarning(
    code="adaptive_pushes",
    text="the pushes were chosen, and stopped, by what earlier ones had said: believe "
    "the posterior intervals; likelihood_sets cover less than they state",
)


def next_text(explorer: Explorer, suggestions: Sequence[Suggestion]) -> str:
    """Ranked pushes as lines."""
    lines = [explorer.state.sentence]
    if suggestions:
        lines += [
            "",
            "  push  theta_deg  alpha_deg   gain  interval after  decides  force (99%)",
        ]
    for rank, push in enumerate(suggestions, start=1):
        width = push.expected_width
        after = f"{width:6.1f} deg" if np.isfinite(width) else "   unknown"
        lines.append(
            f"  {rank:4d}  {push.theta_deg:9.1f}  {push.alpha_deg:9.1f}  "
            f"{push.gain:5.3f}      {after}     {push.p_decided:4.0%}  "
            f"{push.force_q99:11.3g}"
        )
    law = explorer.belief.grasp.law
    if law.sees_tilt and explorer.question.config.grasp.mechanics == "auto":
        lines += ["", f"The object tilts so far that {law.title} are believed."]
    if suggestions and suggestions[0].length_share < 1:
        share = suggestions[0].length_share
        lines += ["", f"Push only {share:.0%} of the length: the force is not known."]
    return "\n".join(lines)


def next_dict(
    explorer: Explorer, suggestions: Sequence[Suggestion]
) -> dict[str, object]:
    """Ranked pushes as a document."""
    return (
        {"schema": SCHEMA, "mechanics": explorer.belief.grasp.mechanics}
        | state_dict(explorer.state)
        | {
            "suggestions": [
                {
                    "theta_deg": push.theta_deg,
                    "alpha_deg": push.alpha_deg,
                    "length_share": push.length_share,
                    "purpose": push.purpose.value,
                    "gain_nat": push.gain,
                    "expected_width_deg": json_safe(push.expected_width),
                    "p_decided": push.p_decided,
                    "force_q99": push.force_q99,
                }
                for push in suggestions
            ],
            "warnings": [asdict(warning) for warning in explorer.belief.warnings],
        }
    )


def state_dict(state: State) -> dict[str, object]:
    """Where an exploration stands, as a document."""
    return {
        "status": state.answer.value,
        "sentence": state.sentence,
        "intervals_deg": {
            name: None if found is None else list(found)
            for name, found in state.intervals.items()
        },
        "p_unlimited": state.p_unlimited,
        "p_budget": state.p_budget,
        "n_pushes": state.n_pushes,
        "n_left": state.n_left,
    }


def progress_line(state: State) -> str:
    """State, interval and forecast in a line."""
    known = ", ".join(
        f"{ANGLES[name].prose} " + ("?" if i is None else f"{i[0]:.1f}° to {i[1]:.1f}°")
        for name, i in state.intervals.items()
    )
    chance = "" if state.p_budget is None else f", chance {state.p_budget:.0%}"
    word = "" if state.answer is Answer.DECIDING else f" - {state.answer.value}"
    return f"{known}{chance}{word}"
