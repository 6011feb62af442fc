"""Rows of words on fit and posterior: the worst of each, and no more than is shown."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from pushfit.report import fact_rows
from pushfit.report.fact_rows import cannot_say, correlation_rows, fit_rows
from pushfit.report.frames import Correlation


def test_directions_that_are_all_fixed_are_nothing_that_cannot_be_said(determined):
    told = determined.identifiability
    open_one = [line for line in cannot_say(determined) if "The heights fix" in line]
    assert open_one[0].startswith(
        f"The heights fix {told.rank} of {told.n_parameters} directions"
    )
    known = replace(determined, identifiability=replace(told, rank=told.n_parameters))
    assert not any("The heights fix" in line for line in cannot_say(known))


@pytest.mark.parametrize(
    ("largest", "words"), [(0.05, "sd 0.0500 N"), (0.08, "sd 0.0500 to 0.0800 N")]
)
def test_noise_is_a_range_where_it_is_not_the_same(largest, words, determined):
    sigma = np.linspace(0.05, largest, determined.fit.sigma.size)
    sigma[0] = np.nan
    sigma[1] = 0.05
    result = replace(determined, fit=replace(determined.fit, sigma=sigma))
    assert dict(fit_rows(result))["noise"] == words


def test_the_worst_of_all_chains_is_told(determined):
    posterior = determined.posterior
    diagnostics = replace(
        posterior.diagnostics,
        autocorr_time={"ln_A": 20.0, "ln_B": 30.0},
        ess={"ln_A": 900.0, "ln_B": 400.0},
        rhat={"ln_A": 1.001, "ln_B": 1.012},
    )
    result = replace(determined, posterior=replace(posterior, diagnostics=diagnostics))
    words = dict(fit_rows(result))["posterior"]
    assert "τ ≤ 30, ESS ≥ 400, R-hat ≤ 1.012" in words


@pytest.mark.parametrize(("n_more", "last"), [(0, "7, 8"), (3, "…")])
def test_of_many_correlations_the_strongest_are_shown(
    n_more, last, determined, monkeypatch
):
    shown = fact_rows.MAX_CORRELATIONS
    names = [*map(str, range(shown + n_more + 1))]
    found = tuple(
        Correlation(first=one, second=other, value=0.9)
        for one, other in itertools.pairwise(names)
    )
    monkeypatch.setattr(fact_rows, "correlations", lambda _: found)
    rows = correlation_rows(determined)
    assert len(rows) == shown + (n_more > 0)
    assert rows[-1][0] == last
    assert rows[-1][1] == ("3 weaker, in summary.json" if n_more else "+0.90")
