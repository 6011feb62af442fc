"""Measured coverage for readers: text and JSON. Excluded: its figure."""

from dataclasses import asdict

from pushfit.fit.coverage import Coverage, CoverageStudy
from pushfit.report.json_values import Json, json_safe
from pushfit.report.strings import symbol

SCHEMA = "pushfit.coverage/1"


def study_text(study: CoverageStudy) -> str:
    """Counts with what they can tell."""
    c = study
    lines = [
        f"{c.n_tables} tables of {c.n_pushes} pushes, truths drawn from the priors, "
        f"engine {c.engine}",
        "truth inside, and the coverages that this count is compatible with (95 %):",
        "",
    ]
    lines += [_line(coverage) for coverage in c.coverages]
    lines.append("")
    for name, counts in c.verdicts.items():
        shares = ", ".join(
            f"{verdict.value} {n}"
            for verdict, n in sorted(counts.items(), key=lambda item: -item[1])
        )
        lines.append(f"{symbol(name)} was called {shares}")
    if c.n_failed:
        lines.append(
            f"{c.n_failed} of {c.n_tables} gave no trusted result and are not counted"
        )
    wrong = [coverage for coverage in c.coverages if not coverage.is_compatible]
    if wrong:
        # One in twenty fails by chance.
        lines.append(
            f"{len(wrong)} of {len(c.coverages)} claims, marked !, lie outside their "
            "limits; one in twenty does so by chance, so measure again with more tables"
        )
    else:
        lines.append(
            "every claim lies inside its limits; "
            "four times as many tables would halve them"
        )
    return "\n".join(lines)


def study_dict(study: CoverageStudy) -> dict[str, Json]:
    """The same as one JSON-safe document."""
    content = {
        "schema": SCHEMA,
        "n_tables": study.n_tables,
        "n_failed": study.n_failed,
        "n_pushes": study.n_pushes,
        "engine": study.engine,
        "seed": study.seed,
        "coverage": [
            asdict(coverage)
            | {
                "share": coverage.share,
                "limits": coverage.limits,
                "is_compatible": coverage.is_compatible,
            }
            for coverage in study.coverages
        ],
        "verdicts": {
            name: {verdict.value: n for verdict, n in counts.items()}
            for name, counts in study.verdicts.items()
        },
    }
    return {key: json_safe(value) for key, value in content.items()}


def _line(coverage: Coverage) -> str:
    low, high = coverage.limits
    mark = " " if coverage.is_compatible else "!"
    claim = f"{symbol(coverage.name):<5} {100 * coverage.prob:3g} % {coverage.kind:<8}"
    count = f"{coverage.n_held} of {coverage.n_tables}"
    return f"{mark} {claim} {count:>12}  {100 * low:3.0f} to {100 * high:3.0f} %"
