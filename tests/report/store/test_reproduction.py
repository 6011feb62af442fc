"""Comparing a result folder with a second computation of it, number by number."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pushfit.errors import DataError
from pushfit.report.store.folder import write_result_folder
from pushfit.report.store.read import read_summary
from pushfit.report.store.reproduction import SHARE_OF_WIDTH, compare_result
from tests.tolerances import ROUTES


def shifted(identification, name, by, **changes):
    """A result whose angle has moved by a share of its interval's width."""
    quantity = getattr(identification, name)
    low, high = quantity.interval
    moved = replace(quantity, estimate=(quantity.estimate + by * (high - low)) % 180.0)
    return replace(identification, **{name: moved}, **changes)


def test_a_result_equals_itself_in_every_number(result, determined):
    comparison = compare_result(result, read_summary(result), determined)
    assert comparison.is_exact
    assert comparison.is_reproduced
    assert dict(comparison.environment) == {}
    n_draws = sum(draws.size for draws in determined.posterior.samples.values())
    assert comparison.n_numbers > n_draws


def test_a_changed_number_of_the_summary_is_named(result, determined):
    summary = read_summary(result)
    estimate = summary["parameters"]["L"]["estimate"]
    # The last bit is enough where versions and platform are the same.
    summary["parameters"]["L"]["estimate"] = np.nextafter(estimate, 1.0).item()
    comparison = compare_result(result, summary, determined)
    assert not comparison.is_reproduced
    (difference,) = comparison.differences
    assert difference.where == "parameters.L.estimate"
    assert difference.found == estimate


def test_a_changed_word_is_named(result, determined):
    summary = read_summary(result)
    summary["theta_c_deg"]["verdict"] = "not_determined"
    (difference,) = compare_result(result, summary, determined).differences
    assert (difference.where, difference.found) == ("theta_c_deg.verdict", "determined")


def test_a_changed_draw_is_named_with_its_value(result, determined):
    posterior = determined.posterior
    draws = posterior.samples["A"].copy()
    draws[3] *= 2
    again = replace(
        determined,
        posterior=replace(posterior, samples={**posterior.samples, "A": draws}),
    )
    differences = compare_result(result, read_summary(result), again).differences
    (found,) = [d for d in differences if d.where == "result.nc: posterior/A"]
    assert (found.recorded, found.found) == (draws[3] / 2, draws[3])
    assert found.relative == 0.5


def test_a_changed_height_is_named(result, determined):
    path = result / "peaks.csv"
    lines = path.read_text().splitlines(keepends=True)
    height = str(determined.table.heights("height")[0])
    lines[1] = lines[1].replace(height, "9.5")
    path.write_text("".join(lines))
    (difference,) = compare_result(result, read_summary(result), determined).differences
    assert difference.where == "peaks.csv: height_n"
    assert difference.recorded == 9.5


@pytest.mark.parametrize(("name", "sign"), [("theta_c", -1), ("alpha_star", 1)])
def test_other_versions_explain_what_draws_scatter_and_no_more(
    name, sign, result, determined
):
    other = {"versions": {**determined.versions, "jax": "0.0.1"}}
    for factor, is_reproduced in ((0.9, True), (1.1, False)):
        again = shifted(determined, name, sign * factor * SHARE_OF_WIDTH, **other)
        comparison = compare_result(result, read_summary(result), again)
        assert not comparison.is_exact
        assert comparison.is_reproduced is is_reproduced
        assert comparison.environment["jax"] == ("0.10.2", "0.0.1")


def with_chi_square(result, share):
    chi_square = result.fit.chi_square * (1 + share * 1e-6)
    return replace(result, fit=replace(result.fit, chi_square=chi_square))


def with_contraction(result, share):
    parameters = tuple(
        replace(q, contraction=q.contraction - share * 0.05) if q.name == "C_rr" else q
        for q in result.parameters
    )
    return replace(result, parameters=parameters)


def with_height(result, share):
    """The lowest one, moved by a share of the tallest."""
    frame = result.table.frame.copy()
    heights = frame["height_n"].to_numpy()
    frame.loc[int(np.argmin(heights)), "height_n"] += share * 1e-6 * heights.max()
    return replace(result, table=replace(result.table, frame=frame))


def with_bound(result, share):
    """One of 61.2° has 28.8° above it."""
    ((low, _),) = result.theta_c.sets
    sets = ((low + share * 0.1 * 28.8, None),)
    return replace(result, theta_c=replace(result.theta_c, sets=sets))


def with_pieces(result, share):
    """A set of a parameter that falls into two, whatever the share."""
    parameters = tuple(
        replace(q, sets=((0.1, 0.2), (0.3, 0.4))) if q.name == "C_rr" else q
        for q in result.parameters
    )
    return with_chi_square(replace(result, parameters=parameters), share)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("determined", with_chi_square),
        ("determined", with_contraction),
        ("determined", with_height),
        ("one_sided", with_bound),
        ("determined", with_pieces),
    ],
)
def test_other_versions_move_each_number_by_its_own_share(
    kind, change, request, tmp_path
):
    """Draws may be any: the largest difference, and told after one that counts."""
    before = request.getfixturevalue(kind)
    out = write_result_folder(before, tmp_path / "result", force=False)
    posterior = before.posterior
    samples = {**posterior.samples, "A": 3 * posterior.samples["A"]}
    other = {"posterior": replace(posterior, samples=samples), "versions": {}}
    for share, is_reproduced in ((0.9, True), (1.1, False)):
        again = replace(change(before, share), **other)
        comparison = compare_result(out, read_summary(out), again)
        assert comparison.is_reproduced is is_reproduced
        assert comparison.differences[0].is_tolerated is is_reproduced


@pytest.mark.usefixtures("undrawn")
def test_draws_without_an_angle_equal_themselves(determined, tmp_path):
    posterior = determined.posterior
    theta_c = np.where(np.arange(posterior.log_prob.size) % 7, 40.0, np.nan)
    samples = {**posterior.samples, "theta_c": theta_c}
    result = replace(determined, posterior=replace(posterior, samples=samples))
    out = write_result_folder(result, tmp_path / "result", force=False)
    assert compare_result(out, read_summary(out), result).is_exact


@pytest.mark.usefixtures("undrawn")
def test_an_axis_that_passes_zero_has_hardly_moved(determined, tmp_path):
    """179.9° and 0.1° are 0.2° apart."""
    axis = replace(determined.alpha_star, estimate=179.9, interval=(177.9, 181.9))
    before = replace(determined, alpha_star=axis)
    out = write_result_folder(before, tmp_path / "axis", force=False)
    again = shifted(before, "alpha_star", 0.05, versions={"pushfit": "0.1.0"})
    assert again.alpha_star.estimate == pytest.approx(0.1, rel=ROUTES)
    assert compare_result(out, read_summary(out), again).is_reproduced


def test_a_folder_that_is_no_result_is_refused(tmp_path):
    with pytest.raises(DataError, match="not a result") as caught:
        read_summary(tmp_path)
    assert caught.value.exit_code == 3
    (tmp_path / "summary.json").write_text(json.dumps({"schema": "other/1"}))
    with pytest.raises(DataError, match="other/1"):
        read_summary(tmp_path)


def test_a_result_that_lacks_its_posterior_is_refused(result, determined):
    (result / "result.nc").unlink()
    with pytest.raises(DataError, match="not a whole result"):
        compare_result(result, read_summary(result), determined)
