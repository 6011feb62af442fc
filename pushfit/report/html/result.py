"""The report as one HTML file that needs nothing else and runs nothing.

Styles and figures are inside; the policy allows no script and no address. Excluded:
rows for a notebook or a paper (`pushfit.report.html.card`).
"""

import base64
import json
from collections.abc import Mapping
from pathlib import PurePath
from types import MappingProxyType

import numpy as np

from pushfit.fit.results import FitStatus, Identification, Quantity
from pushfit.report.answers import alpha_star_answer, theta_c_answer
from pushfit.report.fact_rows import (
    angle_rows,
    cannot_say,
    correlation_rows,
    fit_rows,
    quantity_cells,
)
from pushfit.report.figures.identification import figure_files
from pushfit.report.figures.main import MAX_SWEEPS, main_figure, sweeps_of
from pushfit.report.figures.style import figure_bytes
from pushfit.report.html.pages import render_page

# Dense figures, smaller as pixels than as paths.
AS_PIXELS = frozenset(
    {"corner_parameters", "corner_combinations", "traces", "exploration"}
)
THETA = "Heights against elevation for every azimuth"
ALPHA = "Heights against azimuth, as a curve and around the push frame"
COMPONENTS = (
    " Below, each component of the force with its rest level and its height, drawn "
    "over the shaded stretch that it was measured over."
)
NOTHING: Mapping[str, bytes] = MappingProxyType({})
MIME = {"svg": "image/svg+xml", "png": "image/png"}


def render_html(
    identification: Identification,
    *,
    files: Mapping[str, bytes] | None = None,
    extra: Mapping[str, bytes] = NOTHING,
) -> str:
    """The whole report as one page.

    Args:
        files: Figures as `figure_files` makes them; None makes them here.
        extra: Files of the folder that no identification makes; pictures are shown.
    """
    files = dict(files or figure_files(identification, is_wanted=is_shown))
    stacked = main_figure(identification, is_stacked=True)
    files["main_stacked.svg"] = figure_bytes(stacked, "svg")
    content = _content(identification) | {"images": _images({**files, **extra})}
    return render_page("report.html.j2", content)


def is_shown(name: str, suffix: str) -> bool:
    """Whether a page shows a figure in this format."""
    return suffix == ("png" if name in AS_PIXELS else "svg")


def _images(files: Mapping[str, bytes]) -> dict[str, str]:
    images = {}
    for file, content in files.items():
        name, _, suffix = file.rpartition(".")
        if is_shown(name, suffix):
            text = base64.b64encode(content).decode("ascii")
            images[name] = f"data:{MIME[suffix]};base64,{text}"
    return images


def _content(identification: Identification) -> dict[str, object]:
    status, table = identification.status, identification.table
    # A path says more than a reader asks; the whole of it is under Provenance.
    paths = [trace.path for trace in table.traces] or [s.path for s in table.sources]
    names = dict.fromkeys(PurePath(path).name for path in paths)
    heading = ", ".join(names) or "Push exploration"
    return {
        "heading": heading,
        "table": table,
        "n_used": int(np.sum(identification.used)),
        "status_text": "" if status is FitStatus.OK else status.value,
        "quality": identification.goodness_of_fit,
        "answers": (theta_c_answer(identification), alpha_star_answer(identification)),
        "main_caption": _main_caption(identification),
        "sweeps": _sweep_captions(identification),
        "recordings": _recording_captions(identification),
        "warnings": identification.warnings,
        "cannot_say": cannot_say(identification),
        "angles": angle_rows(identification),
        "prob": f"{100 * identification.theta_c.prob:g} %",
        "parameters": _rows(identification.parameters),
        "combinations": _rows(identification.combinations),
        "correlations": correlation_rows(identification),
        "fit": fit_rows(identification),
        "versions": identification.versions.items(),
        "config": json.dumps(stated_config(identification), indent=2),
    }


def stated_config(identification: Identification) -> dict[str, object]:
    """Settings that were stated, and those that every number depends on."""
    config = identification.config
    stated = config.model_dump(mode="json", exclude_defaults=True)
    # A default push length is an assumption of the reader's as well.
    push = config.push.model_dump(mode="json")
    return {"push": push, **{k: v for k, v in stated.items() if k != "push"}}


def _rows(quantities: tuple[Quantity, ...]) -> list[tuple[str, ...]]:
    return [(q.name, *quantity_cells(q)) for q in quantities]


def _main_caption(identification: Identification) -> str:
    if identification.posterior.status is not FitStatus.OK:
        return "Peak heights of the pushes and the best fit."
    return (
        "Peak heights of the pushes, the best fit and the credible band; dashed: the "
        "answer; shaded, and between two tips above: its set."
    )


def _sweep_captions(identification: Identification) -> list[tuple[str, str]]:
    channels = identification.table.channels
    captions = {"theta": THETA, "alpha": ALPHA}
    if len(sweeps_of(identification, "theta", channels[0])) <= MAX_SWEEPS:
        del captions["theta"]  # all are in the main figure
    return [
        (f"{swept}{kind}", f"{words}{kind.replace('_', ', ')}.")
        for swept, words in captions.items()
        for kind in (channel.removeprefix("height") for channel in channels)
    ]


def _recording_captions(identification: Identification) -> list[tuple[str, str]]:
    return [
        (
            f"recording_{index}",
            f"{trace.path}: the signal, and where each push was measured "
            "from its baseline; doubtful pushes in red."
            + (COMPONENTS if trace.components else ""),
        )
        for index, trace in enumerate(identification.table.traces, start=1)
    ]
