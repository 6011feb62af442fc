"""A study of coverage as text and JSON: counts, and what they can tell."""

import json

import numpy as np

from pushfit.fit.coverage import Coverage, CoverageStudy
from pushfit.fit.results import Verdict
from pushfit.report.figures.diagnostics import study_figure
from pushfit.report.text.coverage import (
    study_dict,
    study_text,
)
from tests.tolerances import EXACT


def made(n_held: int) -> CoverageStudy:
    """Twenty tables, of which one failed."""
    rows = [("interval", 0.5, 10), ("interval", 0.9, n_held), ("set", 0.9, 0)]
    return CoverageStudy(
        coverages=tuple(
            Coverage(
                name="theta_c",
                kind=kind,
                prob=prob,
                n_held=held,
                n_tables=0 if kind == "set" else 19,
            )
            for kind, prob, held in rows
        ),
        verdicts={"theta_c": {Verdict.DETERMINED: 4, Verdict.NOT_DETERMINED: 15}},
        n_tables=20,
        n_failed=1,
        n_pushes=51,
        engine="sweep",
        seed=0,
    )


def test_a_claim_inside_its_limits_is_not_marked():
    text = study_text(made(17))
    assert "!" not in text
    assert "every claim lies inside its limits" in text
    assert "θ_c was called not_determined 15, determined 4" in text
    assert "1 of 20 gave no trusted result" in text


def test_a_claim_outside_its_limits_is_marked():
    """10 of 19 is compatible with 76 % at most."""
    text = study_text(made(10))
    marked = [line for line in text.splitlines() if line.startswith("!")]
    assert len(marked) == 1
    assert "90 % interval" in marked[0]
    assert "10 of 19" in marked[0]


def test_the_document_is_strict_json_and_says_unknown_as_null():
    document = study_dict(made(17))
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert document["schema"] == "pushfit.coverage/1"
    by_kind = {(c["kind"], c["prob"]): c for c in document["coverage"]}
    assert by_kind["set", 0.9]["share"] is None
    assert by_kind["interval", 0.9]["share"] == 17 / 19
    assert by_kind["interval", 0.9]["is_compatible"]


def test_the_figure_shows_what_was_measured():
    (axes,) = study_figure(made(17)).axes
    (container,) = axes.containers
    drawn = np.asarray(container.lines[0].get_ydata(), dtype=float)
    np.testing.assert_allclose(drawn, [100 * 10 / 19, 100 * 17 / 19], rtol=EXACT)
