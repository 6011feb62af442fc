"""A comparison of models as text and JSON: scores, and what they tell."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pushfit.fit.results import FitStatus
from pushfit.report.text.comparison import (
    comparison_dict,
    comparison_sentences,
    comparison_text,
)
from tests.report.makers import make_comparison


def test_models_that_the_heights_do_not_tell_apart_are_named():
    """ln B = -0.4 is below 1, and e^16.3 is 1.2 · 10^7."""
    first, second = comparison_sentences(make_comparison())
    assert first == (
        "By evidence these heights cannot tell hard and soft (p = 8) apart, and speak "
        "against no rolling (10^7 to 1)."
    )
    # 20 · 0.9 and sqrt(20) · 0.2
    assert second == (
        "By predicting each push from the others these heights cannot tell hard and "
        "soft (p = 8) apart, and speak against no rolling (elpd lower by 18.0 ± 0.9)."
    )


def test_a_model_that_is_the_configured_one_is_not_compared_with_it():
    found = replace(make_comparison(), left_out=("proportional",))
    first, *_ = comparison_sentences(found)
    assert "no proportional noise" in first
    assert comparison_dict(found)["left_out"] == ["proportional"]


def test_a_single_best_model_is_favoured():
    found = make_comparison(evidence=(12.0, 10.0, 9.0), elpd=(0.0, -0.5, -0.5))
    first, second = comparison_sentences(found)
    # e^2 and e^3
    assert "favour hard, and speak against soft (p = 8) (7.39 to 1)" in first
    assert "no rolling (20.1 to 1)" in first
    assert "favour hard, and speak against" in second


def test_odds_of_thousands_are_whole_numbers():
    """e^8 = 2981, e^9.3 = 10938."""
    first, _ = comparison_sentences(make_comparison(evidence=(10.0, 2.0, 0.7)))
    assert "soft (p = 8) (2980 to 1)" in first
    assert "no rolling (10^4 to 1)" in first


def test_without_evidence_the_reason_is_given_by_name():
    found = make_comparison(evidence=None)
    first, *rest = comparison_sentences(found)
    assert first == (
        "There is no evidence to compare, because the stiffness ellipse adds two "
        "dimensions."
    )
    assert len(rest) == 1
    assert comparison_dict(found)["models"]["hard"]["log_evidence"] is None


def test_the_only_evidence_is_not_called_the_best():
    """Linear mechanics have one, tilting mechanics have none."""
    found = make_comparison(evidence=(None, None, -4.0))
    assert all(score.log_bayes_factor is None for score in found.models)
    assert comparison_dict(found)["models"]["no_rolling"]["log_evidence"] == -4.0
    assert "-4.00" in comparison_text(found)


@pytest.mark.parametrize(
    ("pareto_k", "words"),
    [(0.91, "the largest 0.91"), (np.inf, "or draws so few that none can be told")],
)
def test_unreliable_importance_sampling_is_said(pareto_k, words):
    found = make_comparison()
    densities = found.models[0].densities
    k = densities.pareto_k.copy()
    k[3] = pareto_k
    doubtful = replace(densities, pareto_k=k)
    models = (replace(found.models[0], densities=doubtful), *found.models[1:])
    sentences = comparison_sentences(replace(found, models=models))
    assert sentences[-1] == (
        "The elpd of hard is not reliable: 1 of 20 pushes have a Pareto k above 0.70, "
        f"{words}."
    )


def test_the_best_has_no_error_beside_itself():
    """Every standard error of a score is above 0; that of no difference is 0."""
    assert "± 0.0" not in comparison_text(make_comparison())


def test_the_only_model_that_predicts_pushes_is_not_favoured():
    hard, *others = make_comparison(evidence=None).models
    alone = {"densities": None, "elpd_difference": None, "elpd_difference_se": None}
    models = (hard, *(replace(other, **alone) for other in others))
    sentences = comparison_sentences(replace(make_comparison(), models=models))
    assert not any("By predicting" in s for s in sentences)
    assert any("No push is predicted from the others by soft" in s for s in sentences)


def test_one_model_that_describes_the_heights_is_enough():
    hard, *others = make_comparison().models
    models = (replace(hard, is_adequate=False), *others)
    found = replace(make_comparison(), models=models)
    assert "None of the models" not in comparison_text(found)


def test_that_no_model_describes_the_heights_comes_first():
    found = make_comparison(is_adequate=False, verdict="Residuals follow θ.")
    text = " ".join(comparison_text(found).split())
    assert text.startswith("None of the models describes these heights")
    assert "Residuals follow θ." in text
    assert comparison_dict(found)["sentences"][0].startswith("None of the models")


def test_untrusted_models_are_named_first_and_not_ranked():
    found = make_comparison(
        evidence=None, status=FitStatus.NOT_CONVERGED, engine="emcee"
    )
    models = tuple(
        replace(m, densities=None, elpd_difference=None, elpd_difference_se=None)
        for m in found.models
    )
    found = replace(found, models=models)
    assert comparison_text(found).startswith("Do not use the numbers of hard: the")
    sentences = comparison_sentences(found)
    assert not any("By predicting" in s or "No push" in s for s in sentences)
    assert found.status is FitStatus.NOT_CONVERGED


@pytest.mark.parametrize("evidence", [(12.3, 11.9, -4.0), None, (-1e5, -1e5, -2e5)])
def test_text_fits_80_columns_and_the_document_is_strict_json(evidence):
    found = make_comparison(evidence=evidence, elpd=(-300.0, -301.0, -9000.0))
    assert max(map(len, comparison_text(found).splitlines())) <= 80
    document = comparison_dict(found)
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert document["schema"] == "pushfit.compare/1"
    assert list(document["models"]) == ["hard", "soft", "no_rolling"]


def test_a_sharpness_that_is_unknown_is_no_number():
    found = make_comparison()
    open_ = tuple(
        replace(m, sharpness=None) if m.name == "soft" else m for m in found.models
    )
    found = replace(found, models=open_)
    assert "soft (p free)" in comparison_text(found)
    models = comparison_dict(found)["models"]
    assert models["soft"]["sharpness"] == "auto"
    assert models["hard"]["sharpness"] == "hard"
