"""How far a command is: a bar on a terminal, else a line for each stage.

All of it goes to standard error; what a command answers goes to standard output.
Excluded: which stages there are (`pushfit.fit.identify.progress`).
"""

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pushfit.report.strings import printable, time_left

if TYPE_CHECKING:
    from rich.progress import Progress

# A stage gets a further line when so much more is done: 10 000 items do not each.
WORTH_A_LINE = 0.03
# Stages that differ in a number alone are one: "table 3 of 200".
NUMBER = re.compile(r"\d+")
# Seconds of which the bar takes the speed: stages are long and few.
MEMORY = 600.0


class ProgressLines:
    """Takes in how far the work is, and says it line by line."""

    def __init__(
        self, say: Callable[[str], None], clock: Callable[[], float] = time.perf_counter
    ) -> None:
        """Start the clock."""
        self._say, self._clock, self._start = say, clock, clock()
        self._last, self._stage = -WORTH_A_LINE, ""

    def __call__(self, stage: str, share: float) -> None:
        """Take in a stage that goes on, and the share of all work that is done."""
        kind = NUMBER.sub("", stage)
        if kind == self._stage and share < self._last + WORTH_A_LINE:
            return
        self._last, self._stage = share, kind
        left = time_left(share, self._clock() - self._start)
        self._say(f"{stage}: {100 * share:.0f} % done{left}")

    def tell(self, text: str) -> None:
        """Print a sentence on what is known before the end."""
        self._say(text)


class Bar(ProgressLines):
    """The same as a bar at the foot of a terminal."""

    def __init__(self, bar: "Progress", say: Callable[[str], None]) -> None:
        """Begin with an empty bar."""
        super().__init__(say)
        self._bar, self._task = bar, bar.add_task("", total=1.0)

    def __call__(self, stage: str, share: float) -> None:
        """Move the bar to a share, and name the stage beside it."""
        self._bar.update(self._task, description=stage, completed=share)


@contextmanager
def shown_bar() -> Iterator[Bar]:
    """A bar while the block runs, and nothing of it afterwards."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True, soft_wrap=True)
    with Progress(
        *columns,
        console=console,
        transient=True,
        speed_estimate_period=MEMORY,
        redirect_stdout=False,
    ) as bar:
        yield Bar(bar, lambda text: console.print(Text(printable(text))))
