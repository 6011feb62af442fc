"""A recording by hand, without a rhythm, in which the eye knows better than a count."""

import re

import numpy as np

from pushfit.cli.look.state import Look
from pushfit.config import read_config
from pushfit.data.recordings.records import Recording

TIME = np.arange(0.0, 26.0, 0.01)
# A top is found within a few samples of 10 ms.
NEAR = 0.05
# Rests are read where rounded humps begin already: heights come out 0.3 % low.
LOW = 5e-3
# Time and height of every hump; the third is somebody touching the table, the fifth is
# a push that hardly met anything.
HUMPS = ((2.0, 1.0), (5.0, 0.8), (8.2, 0.5), (12.0, 1.2), (16.5, 0.02), (22.0, 1.1))
TOUCH, FAINT = 2, 4
DIP = (14.0, -0.6)


def rounded(*tops: tuple[float, float], noise: float = 5e-4) -> np.ndarray:
    """Rounded pushes over a level of 3, and noise."""
    level = 3 + sum(h * np.exp(-(((TIME - t) / 0.5) ** 2)) for t, h in tops)
    return level + noise * np.random.default_rng(0).standard_normal(TIME.size)


def recording(*tops: tuple[float, float], **changes: object) -> Recording:
    """One channel in newtons."""
    return Recording(
        **{
            "time": TIME,
            "channels": {"force": rounded(*(tops or HUMPS))},
            "units": {"force": "n"},
            **changes,
        }
    )


def a_look(*tops: tuple[float, float], **peaks: object) -> Look:
    """The recording as it is shown, under some settings of `[peaks]`."""
    changes = {"peaks": peaks} if peaks else {}
    return Look(recording(*tops), read_config(None, changes=changes))


def markup(page: str) -> str:
    """Tags of a page, without what stands in its scripts and style sheets."""
    inside = r"(<(script|style)[^>]*>).*?(</\2>)"
    return re.sub(inside, r"\1\3", page, flags=re.DOTALL)
