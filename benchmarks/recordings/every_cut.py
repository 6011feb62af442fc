"""Real recordings cut in two anywhere: what becomes of their pushes.

A cut leaves all pushes whole but the one that it goes through. Printed per channel: the
whole pushes beside all cuts and how many of them are lost, and the pushes that were cut
and how many of these carry no flag that keeps them out of a fit. Both are to be 0. Then
how many heights of whole pushes without a flag move by more than a tenth of their
standard deviation, and the largest move: where the cut is beyond the rests that a push
is measured by, and where it is inside of one; what it leaves of that is less, and the
standard deviation that of the height by less, where it is larger. The
recordings are those of `benchmarks.recordings.real_recordings` and of its folder;
pushes that the recording itself cuts are left aside. With `--cuts 0` every rest between
two pushes is cut in its middle.
"""

import argparse
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.recordings.real_recordings import CASES, CHANNEL, load, measured
from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.chosen_humps import find_pushes
from pushfit.data.pushes.feet import Feet
from pushfit.data.recordings.recording import read_recording
from pushfit.data.recordings.records import Recording
from pushfit.data.tables.rules import EXCLUDING_FLAGS

# Fewer samples than these are no recording.
LEAST = 20
# What rounding and the judgement of the noise may change [sd].
MOVED = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """Pushes beside all cuts of a channel.

    Args:
        whole: Pushes that a cut leaves whole.
        lost: Times of the cuts that lose one, one for each [s].
        cut: Pushes that a cut goes through, one for each side that shows them.
        unflagged: Times of the cuts that leave one without a flag [s].
        moves: By how much each whole push without a flag is higher where the cut is
            beyond its rests [sd].
        shortened: The same where the cut is inside one of its rests, by the larger of
            both standard deviations [sd].
    """

    whole: int
    lost: tuple[float, ...]
    cut: int
    unflagged: tuple[float, ...]
    moves: tuple[float, ...]
    shortened: tuple[float, ...]


def recordings(folder: Path) -> Iterator[tuple[str, Recording]]:
    """Channels with pushes that go up, by their names."""
    for name, column, unit, known, _ in CASES:
        if known:
            yield f"{name}, {column}", load(folder, name, column, unit)
    path = folder / "ur5_honeycomb/rigid_kpx_0.0017_2_trial4.bag"
    hall = read_recording(
        path, mapping={CHANNEL: "/trial4.real_hall"}, units={CHANNEL: "au"}
    )
    yield "ur5_honeycomb, -real_hall", of(hall.time, -hall.channels[CHANNEL])
    poke = read_recording(
        folder / "peg_poke/forcetorque-20+0.txt",
        columns=("fx_n", "fy_n", "fz_n", "..."),
        rate=125.0,
    )
    yield "peg_poke, -fz", of(poke.time, -poke.channels["fz"])
    press = read_recording(folder / "indenter_ddf/1000 mN data file.ddf")
    yield "indenter_ddf, AI1", of(press.time, press.channels["AI1"])


def of(time: np.ndarray, signal: np.ndarray) -> Recording:
    """A recording of nothing but one channel."""
    return Recording(time=time, channels={CHANNEL: signal}, units={CHANNEL: "au"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """A push of a part of a recording.

    Args:
        start: Begin [s].
        peak: Time of its top [s].
        end: End [s].
        height: Height [unit].
        sd: Standard deviation of it [unit].
        is_out: Whether a flag keeps it out of a fit.
        is_cut: Whether it is flagged as cut.
    """

    start: float
    peak: float
    end: float
    height: float
    sd: float
    is_out: bool
    is_cut: bool


def pushes_of(recording: Recording, part: slice) -> list[Push]:
    """Pushes of a part of a recording."""
    frame = measured(of(recording.time[part], recording.channels[CHANNEL][part]))
    heights = [str(name) for name in frame if str(name).startswith("height_")]
    columns = ("t_start_s", "t_peak_s", "t_end_s", *heights, "flags")
    return [
        Push(
            start=start,
            peak=peak,
            end=end,
            height=height,
            sd=sd,
            is_out=not EXCLUDING_FLAGS.isdisjoint(flags.split(";")),
            is_cut="clipped" in flags,
        )
        for start, peak, end, height, sd, flags in zip(
            *(frame[c] for c in columns), strict=True
        )
    ]


def rests(recording: Recording, pushes: Sequence[Push]) -> list[tuple[float, float]]:
    """Where the rests begin and end that pushes are measured by, or a neighbour [s]."""
    own = {
        push.t_start: Feet.together([push.feet])
        for push in find_pushes(recording, settings=PeakSettings(channel=CHANNEL))
    }
    far = np.array([np.inf])
    feet = [replace(own[push.start], lowest=-far, highest=far) for push in pushes]
    lasts = [-np.inf, *(push.end for push in pushes[:-1])]
    firsts = [*(push.start for push in pushes[1:]), np.inf]
    return [
        (
            max(float(one.before[0][0]), last),
            min(float(one.after()[1][0]), first),
        )
        for one, last, first in zip(feet, lasts, firsts, strict=True)
    ]


def evenly(recording: Recording, n_cuts: int) -> list[int]:
    """So many places, evenly spread over the samples of a recording; at most all."""
    n = len(recording.time)
    return np.unique(np.linspace(LEAST, n - LEAST, n_cuts).astype(int)).tolist()


def middles(recording: Recording) -> list[int]:
    """The middles of the rests between pushes."""
    pushes = pushes_of(recording, slice(None))
    when = [(own.end + other.start) / 2 for own, other in pairwise(pushes)]
    return np.searchsorted(recording.time, when).tolist()


def count(recording: Recording, cuts: Sequence[int]) -> Count:
    """Cut a recording before each of some samples."""
    time = recording.time
    every = pushes_of(recording, slice(None))
    beside = rests(recording, every)
    whole = cut = 0
    lost, unflagged, moves, shortened = [], [], [], []
    for k in cuts:
        for part in (slice(0, k), slice(k, None)):
            first, last = time[part][[0, -1]]
            parts = pushes_of(recording, part)
            for push, (begin, end) in zip(every, beside, strict=True):
                if push.is_cut:
                    continue
                if first <= push.start and push.end <= last:
                    whole += 1
                    same = [own for own in parts if own.start < push.peak < own.end]
                    if not same:
                        lost.append(float(time[k]))
                    elif not (push.is_out or same[0].is_out):
                        move = same[0].height - push.height
                        if begin < time[k] < end:
                            shortened.append(move / max(push.sd, same[0].sd))
                        else:
                            moves.append(move / push.sd)
                elif push.start < last and first < push.end:
                    is_out = [
                        own.is_out for own in parts if push.start < own.peak < push.end
                    ]
                    cut += bool(is_out)
                    if not all(is_out):
                        unflagged.append(float(time[k]))
    return Count(
        whole=whole,
        lost=tuple(lost),
        cut=cut,
        unflagged=tuple(unflagged),
        moves=tuple(moves),
        shortened=tuple(shortened),
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "folder", nargs="?", default=os.environ.get("PUSHFIT_REAL_DATA")
    )
    parser.add_argument("--cuts", type=int, default=200, help="evenly; 0: in rests")
    options = parser.parse_args()
    print(
        "recording | whole pushes | lost | cut pushes | unflagged | cuts of these [s] "
        "| heights that move, cut beyond their rests | largest move [sd] "
        "| cut inside a rest | largest move [sd]"
    )
    print("|".join(["---"] * 10))
    for name, recording in recordings(Path(options.folder)):
        n_cuts = options.cuts
        cuts = evenly(recording, n_cuts) if n_cuts else middles(recording)
        c = count(recording, cuts)
        where = ", ".join(f"{t:.2f}" for t in sorted({*c.lost, *c.unflagged})[:6])
        cells = [name, c.whole, len(c.lost), c.cut, len(c.unflagged), where or "-"]
        for moves in (c.moves, c.shortened):
            size = np.abs([0.0, *moves])
            cells += [np.count_nonzero(size > MOVED), f"{size.max():.2f}"]
        print(" | ".join(map(str, cells)), flush=True)


if __name__ == "__main__":
    main()
