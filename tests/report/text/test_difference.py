"""Two results side by side: the differences of known posteriors."""

import json
import re
from dataclasses import replace
from math import erf

import numpy as np
import pytest

from pushfit.cli import main
from pushfit.errors import DataError
from pushfit.fit.results import Verdict
from pushfit.report.figures.posterior import forest_figure
from pushfit.report.store import read as stored
from pushfit.report.text.difference import (
    compare_results,
    difference_text,
    sentence,
    subtracted,
)
from tests.report.makers import make_angle
from tests.tolerances import EXACT

# Four standard errors of the median of 2000 differences of draws with an sd of 1.2°.
SHIFT = 0.2

# Medians and shares of 20 000 draws: 5 standard errors.
N = 20_000
TOL_MEDIAN, TOL_PROB = 5 * 1.25 / np.sqrt(N), 5 * 0.5 / np.sqrt(N)


@pytest.fixture
def later(determined, make_identification):
    """The same grasp with θ_c 5° higher, of other pushes."""
    samples = dict(determined.posterior.samples)
    samples["theta_c"] = samples["theta_c"] + 5.0
    (source,) = determined.table.sources
    other = replace(source, sha256="11" * 32, path="later.csv")
    return make_identification(
        theta_c=make_angle("theta_c", 45.123),
        posterior=replace(determined.posterior, samples=samples),
        table=replace(determined.table, sources=(other,)),
    )


def test_independent_normals_differ_as_they_must():
    """N(1, 1) minus N(0, 1) is N(1, 2), larger with probability Φ(1/√2)."""
    rng = np.random.default_rng(0)
    change = subtracted(
        np.sort(rng.normal(0.0, 1.0, N)),
        np.sort(rng.normal(1.0, 1.0, N)),
        is_axis=False,
    )
    assert np.median(change) == pytest.approx(1.0, abs=np.sqrt(2) * TOL_MEDIAN)
    assert np.mean(change > 0) == pytest.approx((1 + erf(0.5)) / 2, abs=TOL_PROB)
    assert np.var(change) == pytest.approx(2.0, rel=5 * np.sqrt(2 / N))


def test_an_axis_is_subtracted_the_shorter_way_round():
    change = subtracted(np.full(10, 178.0), np.full(10, 3.0), is_axis=True)
    np.testing.assert_allclose(change, 5.0, rtol=EXACT)


def test_what_changed_is_clear_and_what_did_not_is_not(determined, later):
    found = {d.name: d for d in compare_results(determined, later).differences}
    assert found["theta_c"].is_clear
    assert found["theta_c"].estimate == pytest.approx(5.0, abs=SHIFT)
    assert not found["alpha_star"].is_clear
    text = difference_text(compare_results(determined, later))
    assert "the second is 5" in text
    assert "no clear difference" in text


def test_what_is_smaller_is_as_clear_as_what_is_larger(determined, later):
    """θ_c has an sd of 1.2°: 5° are three of those of the difference, or 99.8 %."""
    for pair, word in (
        ((determined, later), "larger"),
        ((later, determined), "smaller"),
    ):
        first, *_ = compare_results(*pair).differences
        assert first.is_clear
        assert f" {word} (90 %" in sentence(first)
        assert re.search(r"; 99\.\d %\)$", sentence(first))


@pytest.mark.parametrize(("never", "is_compared"), [(0.04, True), (0.06, False)])
def test_an_angle_that_few_draws_lack_is_compared(
    determined, later, never, is_compared
):
    samples = dict(later.posterior.samples)
    draws = samples["theta_c"].copy()
    draws[: round(never * draws.size)] = np.nan
    lacking = replace(later.posterior, samples=samples | {"theta_c": draws})
    found = compare_results(determined, replace(later, posterior=lacking))
    assert ("theta_c" in {one.name for one in found.differences}) is is_compared


def test_results_of_the_same_pushes_are_refused(determined):
    with pytest.raises(DataError, match="not independent"):
        compare_results(determined, determined)
    explored = replace(determined, table=replace(determined.table, sources=()))
    with pytest.raises(DataError, match="equal rows, so they are not independent"):
        compare_results(explored, explored)


def test_results_by_other_mechanics_are_told_of(determined, later):
    assert not compare_results(determined, later).notes
    (own, *_) = later.by_mechanics
    tilted = replace(later, by_mechanics=(replace(own, mechanics="tilting"),))
    text = difference_text(compare_results(determined, tilted))
    assert "by linear mechanics, the second by tilting mechanics" in text


def test_what_cannot_be_compared_is_said(determined, later, not_converged):
    turned = replace(later, reference_alpha_deg=0.0)
    found = compare_results(determined, turned)
    assert {"alpha_star", "A"} <= {one.name for one in found.differences}
    left, *_ = found.left_out
    assert left == (
        "θ_c, because it belongs to α = 0° and 90°; state grasp.reference_alpha_deg"
    )
    with pytest.raises(DataError, match="not to be trusted"):
        compare_results(later, not_converged)


@pytest.mark.parametrize(
    ("verdict", "note", "said"),
    [
        (
            Verdict.DETERMINED,
            "not quoted: the push length is not known",
            "in the first result it is not quoted: the push length is not known",
        ),
        (Verdict.DETERMINED, "", "in the first result it is not quoted"),
        (Verdict.NOT_DETERMINED, "", "in the first result it is not determined"),
        (Verdict.FIXED, "fixed", "in the first result it is fixed"),
        (Verdict.ASSUMED, "", "the first result has it from the prior alone"),
    ],
)
def test_why_a_quantity_is_not_compared_is_a_plain_sentence(
    determined, later, verdict, note, said
):
    """Without a push length A is determined, and yet not quoted."""
    first, *others = determined.combinations
    first = replace(first, estimate=None, interval=None, verdict=verdict, note=note)
    ours = replace(determined, combinations=(first, *others))
    lines = difference_text(compare_results(ours, later)).splitlines()
    assert f"not compared: {first.name}, because {said}" in lines


def test_several_modes_have_an_interval_and_nothing_to_subtract(two_modes, later):
    left, *_ = compare_results(two_modes, later).left_out
    assert left == "θ_c, because in the first result it is several modes"


def test_the_figure_has_a_row_for_each_quantity(determined, later):
    differences = compare_results(determined, later).differences
    figure = forest_figure(differences, labels=("before", "after"))
    assert len(figure.axes) == len(differences)
    low, high = figure.axes[0].lines[0].get_xdata()
    assert (low, high) == determined.theta_c.interval


def test_a_picture_of_nothing_is_said_not_to_be_drawn(
    determined, later, tmp_path, monkeypatch, capsys
):
    ours = replace(determined, combinations=(), parameters=())
    ours = replace(ours, **{a: dropped(ours, a) for a in ("theta_c", "alpha_star")})
    results = {"before": ours, "after": later}
    monkeypatch.setattr(stored, "read_result", lambda folder: results[folder.name])
    plot = tmp_path / "diff.svg"
    assert main(["diff", "before", "after", "--plot", str(plot)]) == 0
    said = capsys.readouterr().err
    assert f"warning: {plot} is not drawn: nothing can be compared (θ_c, bec" in said
    assert "α*, because in the first result it is not determined" in said
    assert not plot.exists()


def dropped(result, name):
    unknown = {"estimate": None, "interval": None, "verdict": Verdict.NOT_DETERMINED}
    return replace(getattr(result, name), **unknown)


def test_the_command_prints_one_document(
    determined, later, tmp_path, monkeypatch, capsys
):
    results = {"before": determined, "after": later}
    monkeypatch.setattr(stored, "read_result", lambda folder: results[folder.name])
    plot = tmp_path / "diff.svg"
    assert main(["diff", "before", "after", "--json", "--plot", str(plot)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "pushfit.difference/1"
    assert document["differences"]["theta_c"]["is_clear"]
    assert plot.read_text().startswith("<?xml")
