"""What is wrong with one recording, collected before any of it is raised.

Excluded: the rules, of clocks (`pushfit.data.recordings.clock`) and of samples
(`pushfit.data.recordings.samples`).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Int

from pushfit.data.text.faults import problem
from pushfit.errors import InputProblem

# Faults of one kind that are listed; the others are counted.
MAX_LISTED = 10

Lines = Callable[[Int[np.ndarray, " m"]], Int[np.ndarray, " m"]]


@dataclass(slots=True, kw_only=True)
class Findings:
    """Problems, notes and cautions about one recording.

    Args:
        path: File as the user named it.
        lines: Gives the line in the file of each sample, counted from 0.
        problems: What it is refused for.
        notes: What is told of it.
        cautions: Of that, what the user should not overlook.
    """

    path: str
    lines: Lines | None
    problems: list[InputProblem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    cautions: list[str] = field(default_factory=list)

    def add(self, code: str, text: str, *, at: int | None = None, **cell: str) -> None:
        """Note a problem, perhaps at one sample."""
        line = None
        if at is not None and self.lines:
            line = int(self.lines(np.array([at]))[0])
        self.problems.append(problem(code, text, path=self.path, line=line, **cell))

    def places(self, at: Int[np.ndarray, " m"]) -> str:
        """Name the first of several samples."""
        first, word = at[:MAX_LISTED], "samples"
        numbers = first + 1
        if self.lines:
            numbers, word = self.lines(first), "lines"
        more = ", …" if at.size > MAX_LISTED else ""
        return f"{word} {', '.join(map(str, numbers))}{more}"
