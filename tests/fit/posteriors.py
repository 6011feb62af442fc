"""Posteriors of which only the draws matter."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from pushfit.fit.results import FitStatus, PosteriorResult


def posterior_of(
    samples: Mapping[str, Float[np.ndarray, " n"]],
    prior_samples: Mapping[str, Float[np.ndarray, " m"]] | None = None,
    status: FitStatus = FitStatus.OK,
) -> PosteriorResult:
    """Draws, and those of the prior."""
    return PosteriorResult(
        samples=dict(samples),
        prior_samples=dict(prior_samples or {}),
        log_prob=np.zeros(len(next(iter(samples.values())))),
        chain=None,
        chain_names=(),
        thin=1,
        engine="sweep",
        diagnostics=None,
        log_evidence=None,
        log_evidence_error=None,
        seed=0,
        status=status,
    )
