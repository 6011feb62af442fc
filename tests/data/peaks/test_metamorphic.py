"""A push's height does not depend on what else the recording holds.

Each recording is changed where the pushes that are looked at are not: it is cut, given
more or fewer pushes, another rest level, sign, time or unit. Heights must be the same
to a tenth of their standard deviation.
"""

from dataclasses import dataclass, replace
from itertools import cycle, pairwise

import numpy as np
import pytest

from benchmarks.recordings.every_cut import (
    count,
    evenly,
    middles,
    pushes_of,
    recordings,
)
from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import measure_pushes
from pushfit.data.recordings.recording import read_recording
from pushfit.data.recordings.records import Recording
from pushfit.data.tables.rules import EXCLUDING_FLAGS
from pushfit.errors import DataError

pytestmark = pytest.mark.repeated

# What rounding and the judgement of the noise may change.
SAME = 0.1
# Times since 1970 keep a quarter of a microsecond of steps of 10 ms.
CLOCK = 0.001
RNG = 7
# Share of heights that may move by more: none does, and .02 to .05 where feet are found
# once or noise is that of the file.
FEW = 0.01
# A sensor falls by so much on release, and comes back. A drift through what is shown of
# that would move the middle of the last push by 1.7 or more.
FALL, NO_DRIFT = 6.0, 1.0
FEET = 0.1  # a quarter of a flank, on which a foot is found [s]
SHOWN = 2.5  # a rest on either side shows a drift to less than half of it
RESAMPLED = 2.0  # other samples have other noise [sd]
HELD = 0.3  # a hold of 1.4 N is read and not guessed: to a fifth of it, at two sd [N]
CREEP = 0.03  # holds of the robot creep by more than this while they last [au]
DRIFT = 0.003  # rests beside the push of the indenter wander by some mN [N]


def simulated(heights=(100.0, 160.0, 130.0, 90.0, 150.0, 120.0), *, shape="triangle"):
    """Pushes of two seconds and rests of two, with noise of one."""
    time = np.arange(0.0, 4.0 * len(heights) + 2.0, 0.01)
    y = np.zeros(time.size)
    for k, height in enumerate(heights):
        since = np.abs(time - 4.0 * k - 3.0)
        course = np.clip(1 - since, 0, None)
        if shape == "trapezoid":
            course = np.clip(2.5 * course, 0, 1)
        y += height * course
    return time, y + np.random.default_rng(RNG).standard_normal(time.size)


@dataclass(frozen=True)
class Push:
    """What a table says of a push."""

    height: float
    sd: float
    start: float
    end: float
    definition: str
    flags: str


def measured(time, y, **settings) -> list[Push]:
    """All pushes as a table has them."""
    recording = Recording(time=time, channels={"p": y}, units={"p": "n"})
    try:
        frame = measure_pushes(recording, settings=PeakSettings(**settings)).frame
    except DataError as error:
        if error.code != "no_pushes":
            raise
        return []
    columns = ("height_n", "height_sd_n", "t_start_s", "t_end_s", "definition", "flags")
    rows = zip(*(frame[column] for column in columns), strict=True)
    return [Push(*row) for row in rows]


def assert_same(found, expected, *, gain=1.0):
    """The pushes are the same ones, with the same heights and definitions."""
    assert len(found) == len(expected)
    for own, other in zip(found, expected, strict=True):
        assert own.definition == other.definition
        assert abs(own.height / gain - other.height) < SAME * other.sd
        assert "clipped" not in own.flags


SHAPES = pytest.mark.parametrize("shape", ["triangle", "trapezoid"])


@SHAPES
@pytest.mark.parametrize("n_before", [1, 2, 3, 4, 5])
def test_cut_at_a_rest_both_parts_keep_their_heights(shape, n_before):
    time, y = simulated(shape=shape)
    whole = measured(time, y)
    cut = np.searchsorted(time, 4.0 * n_before + 1.0)
    assert_same(measured(time[:cut], y[:cut]), whole[:n_before])
    assert_same(measured(time[cut:], y[cut:]), whole[n_before:])


@SHAPES
@pytest.mark.parametrize(
    ("n_before", "share"), [(1, 0.2), (3, 0.4), (1, 0.5), (3, 0.6), (1, 0.8)]
)
def test_cut_inside_a_push_that_one_is_clipped_and_the_rest_the_same(
    shape, share, n_before
):
    time, y = simulated(shape=shape)
    whole = measured(time, y)
    cut = np.searchsorted(time, 4.0 * n_before + 2.0 + 2.0 * share)
    left = measured(time[:cut], y[:cut])
    right = measured(time[cut:], y[cut:])
    assert "clipped" in left[-1].flags
    assert "clipped" in right[0].flags
    assert_same(left[:-1], whole[:n_before])
    assert_same(right[1:], whole[n_before + 1 :])


@pytest.mark.parametrize("is_end", [False, True])
@pytest.mark.parametrize("level", [0.05, 0.1, 0.13, 0.15, 0.17, 0.19])
def test_a_flank_that_is_cut_below_the_other_rest_is_clipped(level, is_end):
    """A push comes back to a fifth of its height; so do those beyond it."""
    time, y = simulated([1000.0] * 4)
    y = y + np.clip(200.0 * (time - 3.0), 0.0, 200.0)
    part = time > 2.0 + level
    time, y = time[part], y[part]
    found = measured(*((-time[::-1], y[::-1]) if is_end else (time, y)))
    assert len(found) == 4
    flags = [push.flags for push in found]
    assert flags == (["", "", "", "clipped"] if is_end else ["clipped", "", "", ""])


@SHAPES
@pytest.mark.parametrize("is_end", [False, True])
@pytest.mark.parametrize("shown", [0.08, 0.1])
def test_a_push_with_little_of_a_rest_beside_it_is_whole(shape, shown, is_end):
    time, y = simulated([1000.0] * 4, shape=shape)
    part = time > 2.0 - shown
    time, y = time[part], y[part]
    found = measured(*((-time[::-1], y[::-1]) if is_end else (time, y)))
    assert [push.flags for push in found] == [""] * 4


@SHAPES
@pytest.mark.parametrize("is_end", [False, True])
@pytest.mark.parametrize("rate", [-1.5, 1.5])
def test_an_sd_holds_the_drift_that_one_rest_alone_does_not_show(shape, rate, is_end):
    """Only 60 ms of a rest are shown; other pushes show how the level drifts."""
    heights = [160.0] * 5
    time, y = simulated(heights, shape=shape)
    y = y + rate * time
    part = time < 20.06 if is_end else time > 1.94
    first, *others, last = measured(time[part], y[part])
    assert len(others) == len(heights) - 2
    own, seen = (last, first) if is_end else (first, last)
    off = abs(own.height - np.median([push.height for push in others]))
    assert off < own.sd < SHOWN * off
    assert own.sd > SHOWN * seen.sd


@SHAPES
@pytest.mark.parametrize("shown", [0.3, 0.5])
def test_what_a_sensor_has_no_time_to_recover_from_is_no_drift(shape, shown):
    """It falls by 6 on release; the recording ends while it is on its way back."""
    time, y = simulated(shape=shape)
    for release in 4.0 + 4.0 * np.arange(6):
        since = time - release
        y = y - np.where(since > 0, FALL * np.exp(-since / 0.4), 0.0)
    whole = measured(time, y)
    cut = np.searchsorted(time, 12.0 + shown)
    for own, other in zip(measured(time[:cut], y[:cut]), whole[:3], strict=True):
        assert abs(own.height - other.height) < NO_DRIFT


@pytest.mark.parametrize("is_end", [False, True])
@pytest.mark.parametrize("cut", [33.5, 34.5])
def test_an_end_of_the_samples_moves_no_rest_of_a_slow_push(cut, is_end):
    """Its flanks take 40 s, and a rest is before a touch that is no foot, at 36 s."""
    time = np.arange(0.0, 160.0, 0.02)
    y = np.interp(time, [40.0, 80.0, 120.0], [0.0, 100.0, 0.0])
    y[(time > 36.2) & (time < 80.0)] += 2.0
    y += 0.1 * np.random.default_rng(RNG).standard_normal(time.size)
    sign = -1 if is_end else 1
    whole, part = (
        measured(sign * time[own][::sign], y[own][::sign])
        for own in (slice(None), time > cut)
    )
    assert_same(part, whole)
    assert abs(part[0].sd - whole[0].sd) < SAME * whole[0].sd


@SHAPES
def test_other_pushes_change_nothing(shape):
    """One repeated, one removed, and another recording appended."""
    time, y = simulated(shape=shape)
    whole = measured(time, y)
    first, second = np.searchsorted(time, [5.0, 9.0])
    repeated = np.concatenate([y[:second], y[first:second], y[second:]])
    longer = np.arange(repeated.size) * 0.01
    assert_same(measured(longer, repeated), [*whole[:2], whole[1], *whole[2:]])
    removed = np.concatenate([y[:first], y[second:]])
    shorter = np.arange(removed.size) * 0.01
    assert_same(measured(shorter, removed), [whole[0], *whole[2:]])
    # More of the other shape, so that a vote of the file would change its mind.
    turned = {"triangle": "trapezoid", "trapezoid": "triangle"}[shape]
    other = simulated((400.0, 380.0, 420.0) * 3, shape=turned)[1]
    appended = np.concatenate([y, other])
    both = measured(np.arange(appended.size) * 0.01, appended)
    assert_same(both[: len(whole)], whole)


@SHAPES
@pytest.mark.parametrize("step", [-300.0, -100.0, 100.0, 300.0])
def test_a_step_of_the_rest_level_is_no_push_and_hides_none(shape, step):
    time, y = simulated(shape=shape)
    stepped = y + step * np.clip((time - 9.0) / 0.2, 0, 1)
    assert_same(measured(time, stepped), measured(time, y))


@SHAPES
@pytest.mark.parametrize("rise", [0.01, 0.2])
@pytest.mark.parametrize(
    ("when", "step"),
    [
        (1.0, 1000.0),
        (1.0, 3000.0),
        *((13.0, k) for k in (-3000.0, -500.0, 500.0, 3000.0)),
        # Two pushes are on the other level, too few to be known by their returns.
        *((9.0, k) for k in (-3000.0, -500.0)),
        *((17.0, k) for k in (500.0, 3000.0)),
    ],
)
def test_a_step_far_larger_than_the_pushes_hides_none(shape, rise, when, step):
    """Beside it less of a rest is read, so that heights agree to two of their sd."""
    time, y = simulated(shape=shape)
    whole = measured(time, y)
    found = measured(time, y + step * np.clip((time - when) / rise, 0, 1))
    assert len(found) == len(whole)
    for own, other in zip(found, whole, strict=True):
        assert abs(own.height - other.height) < 2 * own.sd
        assert not own.flags


@pytest.mark.parametrize("end", [31.0, 31.9, 32.0])
@pytest.mark.parametrize("when", [11.5, 12.0, 12.5])
def test_no_push_beside_a_step_has_two_rows(when, end):
    """By its last samples a level was taken for one that the signal begins with."""
    time = np.arange(0.0, end, 0.02)
    y = np.random.default_rng(RNG).standard_normal(time.size)
    tops = (4.7, 8.7, 16.7, 20.7, 24.7, 28.7)
    for top, height in zip(tops, (460.0, 240, 210, 260, 340, 480), strict=True):
        y += height * np.clip(2.5 - 2.5 * np.abs(time - top), 0, 1)
    found = measured(time, y + 1500.0 * np.clip((time - when) / 0.4, 0, 1))
    assert [push.start for push in found] == pytest.approx(
        [top - 1.0 for top in tops], abs=FEET
    )


@pytest.mark.parametrize("end", [7.5, 7.8, 8.0])
@pytest.mark.parametrize(
    ("on_rest", "on_push"),
    [((0.0, 53.0), (20.0, 35.0)), ((65.0, 54.0, 53.0), (430.0, 230.0))],
    ids=["one alone", "far smaller ones"],
)
def test_wiggles_of_a_push_that_is_cut_are_no_pushes_as_those_before(
    on_rest, on_push, end
):
    """As usual counts what several pushes have, and nothing far higher."""
    time = np.arange(0.0, end, 0.01)
    y = 0.5 * np.random.default_rng(RNG).standard_normal(time.size)
    tops = (*(0.5, 1.7, 2.6)[: len(on_rest)], 6.6, 7.2)
    for top, height in zip(tops, (*on_rest, *on_push), strict=True):
        y += height * np.clip(1 - np.abs(time - top) / 0.2, 0, 1)
    y += max(480.0, 4 * max(on_push)) * np.clip((time - 3.5) / 2.0, 0, 1)
    assert all(push.flags for push in measured(time, y) if push.start > 3.0)


@SHAPES
@pytest.mark.parametrize("when", [9.6, 12.7])
@pytest.mark.parametrize("step", [-100.0, 100.0])
def test_a_step_beside_a_push_is_not_read_into_it(shape, when, step):
    """Less of its rest is read, so that heights agree to two of their sd."""
    time, y = simulated(shape=shape)
    whole = measured(time, y)
    found = measured(time, y + step * (time >= when))
    assert len(found) == len(whole)
    for own, other in zip(found, whole, strict=True):
        assert abs(own.height - other.height) < 2 * own.sd


@SHAPES
def test_sign_time_and_unit_change_nothing(shape):
    time, y = simulated(shape=shape)
    whole = measured(time, y)
    assert_same(measured(time, -y, invert=True), whole)
    assert_same(measured(time + 1.6e9, y), whole)
    for gain in (1e-3, 1e10):
        assert_same(measured(time, gain * y), whole, gain=gain)


@SHAPES
@pytest.mark.parametrize("rate", [80.0, 120.0])
def test_resampled_pushes_are_the_same_within_their_noise(shape, rate):
    """Other samples have other noise: heights agree to two of their sd."""
    time, y = simulated(shape=shape)
    whole = measured(time, y)
    again = np.arange(0.0, time[-1], 1 / rate)
    found = measured(again, np.interp(again, time, y))
    assert len(found) == len(whole)
    for own, other in zip(found, whole, strict=True):
        assert own.definition == other.definition
        assert abs(own.height - other.height) < 2 * other.sd


# Of the longer ones each test takes minutes together.
REAL = {
    "biotac_hand_pushes/trial2": ("pdc", ()),
    "fingertip_force/pressure_index_1_100Hz": ("force_N", pytest.mark.slow),
    "soft_skin/grid_r1.00_3.0N_11-02-2025_15-23-30": ("fz_N", pytest.mark.slow),
    "soft_skin/test_18-02-2025_13-00-43": ("fz_N", pytest.mark.slow),
}


def real(folder, name, column):
    unit = "counts" if column == "pdc" else "n"
    recording = read_recording(
        folder / f"{name}.csv", mapping={"p": column}, units={"p": unit}
    )
    return recording.time, recording.channels["p"]


@pytest.fixture(
    params=[
        pytest.param((name, column), marks=marks, id=name)
        for name, (column, marks) in REAL.items()
    ]
)
def real_signal(real_data, request):
    """Times, samples and pushes of a real recording, and the middles of its rests."""
    time, y = real(real_data, *request.param)
    whole = measured(time, y)
    rests = [(a.end + b.start) / 2 for a, b in pairwise(whole)]
    return time, y, whole, np.searchsorted(time, rests)


def assert_real_same(found, expected, *, within=SAME):
    """None is lost, and no height moves."""
    assert len(found) == len(expected)
    for own, other in zip(found, expected, strict=True):
        assert own.definition == other.definition
        assert abs(own.height - other.height) < within * other.sd


def test_real_recordings_cut_at_rests_keep_their_pushes(real_signal):
    time, y, whole, rests = real_signal
    for k, cut in enumerate(rests, 1):
        left, right = measured(time[:cut], y[:cut]), measured(time[cut:], y[cut:])
        assert_real_same(left, whole[:k])
        assert_real_same(right, whole[k:])
        assert not any("clipped" in push.flags for push in [*left[1:], *right[:-1]])


def test_real_recordings_cut_inside_a_push_flag_it_and_keep_the_rest(real_signal):
    """Also those beside it, unless it is so low that its foot hides in theirs."""
    time, y, whole, _ = real_signal
    for k, share in zip(range(1, len(whole) - 1), cycle([0.5, 0.3, 0.7]), strict=False):
        begin, end = whole[k].start, whole[k].end
        cut = np.searchsorted(time, begin + share * (end - begin))
        left, right = measured(time[:cut], y[:cut]), measured(time[cut:], y[cut:])
        own = [p for p in [*left, *right] if begin < (p.start + p.end) / 2 < end]
        assert own
        assert all(EXCLUDING_FLAGS & {*push.flags.split(";")} for push in own)
        # A small hump may count where all larger ones are in the other part.
        left, right = (
            [
                push
                for push in part
                if any(p.start < (push.start + push.end) / 2 < p.end for p in whole)
                and push not in own
            ]
            for part in (left, right)
        )
        is_low = whole[k].height < min(whole[k - 1].height, whole[k + 1].height) / 2
        within = 0.5 if is_low else SAME
        assert_real_same(left[:-1], whole[: k - 1])
        assert_real_same(right[1:], whole[k + 2 :])
        beside = [left[-1], right[0]], [whole[k - 1], whole[k + 1]]
        assert_real_same(*beside, within=within)


def test_other_pushes_of_a_real_recording_change_nothing(real_signal):
    """One repeated, one removed; a rest that is spliced has another level."""
    time, y, whole, rests = real_signal
    step = np.diff(time, append=2 * time[-1] - time[-2])
    for k in range(1, len(rests), 2):
        before, own, after = np.split(np.arange(time.size), rests[k - 1 : k + 1])
        others = [*whole[: k - 1], *whole[k + 2 :]]
        for kept in ((before, own, own, after), (before, after)):
            rows = np.concatenate(kept)
            times = np.append(0.0, np.cumsum(step[rows])[:-1])
            found = measured(times, y[rows])
            assert len(found) == len(whole) + len(kept) - 3
            beside = slice(k - 1, len(found) - len(whole) + k + 2)
            del found[beside]
            assert_real_same(found, others)


def test_a_recording_appended_to_a_real_one_changes_nothing(real_signal):
    time, y, whole, _ = real_signal
    later = time + time[-1] - time[0] + np.median(np.diff(time))
    both = measured(np.append(time, later), np.append(y, y))
    assert_real_same(both, [*whole, *whole])


@pytest.mark.slow
def test_no_step_of_the_rest_level_of_a_real_recording_is_read_into_a_push(real_signal):
    """In every rest, however short, by the smaller push beside it and by twice as much.

    Heights stay within two of their sd, or are flagged; with the part beside a push
    another part of its rest is read, so that they need not stay to a tenth.
    """
    time, y, whole, rests = real_signal
    for k, rest in enumerate(rests):
        height = min(whole[k].height, whole[k + 1].height)
        for by in (-2, -1, 1, 2):
            found = measured(time, y + by * height * (time >= time[rest]))
            used = [p for p in found if not EXCLUDING_FLAGS & {*p.flags.split(";")}]
            for own in used:
                middle = (own.start + own.end) / 2
                (other,) = (p for p in whole if p.start < middle < p.end)
                assert abs(own.height - other.height) < 2 * max(own.sd, other.sd)
            # At most those beside the step are given up.
            assert len(used) >= len(whole) - 3


def test_sign_time_and_unit_of_a_real_recording_change_nothing(real_signal):
    time, y, whole, _ = real_signal
    for found, gain in (
        (measured(time, -y, invert=True), 1.0),
        (measured(time + 1.6e9, y), 1.0),
        (measured(time, 1e-3 * y), 1e-3),
    ):
        assert [push.flags for push in found] == [push.flags for push in whole]
        scaled = [replace(p, height=p.height / gain, sd=p.sd / gain) for p in found]
        assert_real_same(scaled, whole, within=CLOCK)
        sds = [[push.sd for push in pushes] for pushes in (scaled, whole)]
        np.testing.assert_allclose(*sds, rtol=CLOCK)


@pytest.mark.parametrize("ratio", [0.8, 1.2])
def test_resampled_real_recordings_have_the_same_pushes(real_signal, ratio):
    """Other samples have other noise: heights agree to two of their sd."""
    time, y, whole, _ = real_signal
    again = np.arange(time[0], time[-1], np.median(np.diff(time)) / ratio)
    found = measured(again, np.interp(again, time, y))
    assert [push.definition for push in found] == [p.definition for p in whole]
    pulls = [
        (own.height - p.height) / p.sd for own, p in zip(found, whole, strict=True)
    ]
    assert np.abs(pulls).max() < RESAMPLED


@pytest.fixture(scope="module")
def channels(real_data):
    """Every channel of the real recordings that has pushes, by its name."""
    return dict(recordings(real_data))


def one_of(channels, part):
    (name,) = (name for name in channels if part in name)
    return channels[name]


# Where a cut once lost a push, left one unflagged, or ended in a failure [s].
HARD_CUTS = {
    # At last: a jerk beside what is left of its push.
    "trial2": (13.01, 38.24, 58.005),
    # Wiggles of a hold that is cut, beside pushes that are no higher on their own.
    "force_N": (53.42, 99.26),
    # On the first flank, where the push that swings looks like two.
    "peg_poke": (6.08, 7.61),
    # As many readings inside a push at either end as at rest.
    "short_dropouts": (5.603, 5.91, 6.3),
    "p1_Pa": (95.53,),
    "p0_Pa": (68.67, 68.85, 69.14),
    # A rest level that steps under a push; its flank, at the level of the later rest.
    "real_hall": (1663502488.5572, 1663502488.5832),
    # What follows the last 2 ms of a push, whose top lies before it.
    "AI1": (1.201,),
}


@pytest.mark.parametrize("part", HARD_CUTS)
def test_a_cut_where_little_is_seen_of_a_push_loses_none(channels, part):
    own = one_of(channels, part)
    cuts = count(own, [int(np.abs(own.time - t).argmin()) for t in HARD_CUTS[part]])
    assert (cuts.lost, cuts.unflagged) == ((), ())


def test_what_is_seen_of_a_push_is_no_wiggle_of_the_rest_beside_it(channels):
    """An eighth of the height of the push that ends before it."""
    own = one_of(channels, "trial2")
    cuts = count(own, [int(np.abs(own.time - 39.241).argmin())])
    assert cuts.cut
    assert np.abs(cuts.moves).max() < SAME


@pytest.mark.parametrize(
    ("part", "cuts"),
    [
        # Bumps of an eighth of a push in the rests, as brief as a tenth of it.
        ("soft_skin/grid_r0.20", (53.65, 58.9)),
        # While the next push is held, which is a third as high, or higher.
        ("trial2", (28.2, 30.0, 34.05)),
    ],
)
def test_what_is_beside_the_rest_of_a_real_push_moves_it_nowhere(channels, part, cuts):
    own = one_of(channels, part)
    found = count(own, np.searchsorted(own.time, cuts).tolist())
    assert np.abs([*found.moves, *found.shortened]).max() < SAME


def test_a_wiggle_shows_no_drift_of_the_push_beside_it(channels):
    """Its rests differ as much as those of the push, within a tenth of the time."""
    own = one_of(channels, "soft_skin/grid_r0.20")
    part = slice(int(np.searchsorted(own.time, 84.82)), None)
    assert [push.is_cut for push in pushes_of(own, part)] == [False, False]


@pytest.mark.parametrize("part", ["p0_Pa", "191542, p2_Pa", "soft_skin/grid_r0.20"])
def test_cuts_far_from_bumpy_pushes_leave_their_heights(channels, part):
    """So many that their feet lie elsewhere by where the search began."""
    own = one_of(channels, part)
    moves = np.abs(count(own, evenly(own, 12)).moves)
    assert np.count_nonzero(moves > SAME) <= FEW * len(moves)


@pytest.mark.slow
def test_every_rest_of_a_real_recording_may_be_cut_in_its_middle(channels):
    for name, own in channels.items():
        cuts = count(own, middles(own))
        moves = np.abs([*cuts.moves, *cuts.shortened])
        assert cuts.lost == (), name
        assert moves.max(initial=0.0) < SAME, name


@pytest.mark.slow
def test_no_cut_of_a_real_recording_loses_a_push_or_leaves_a_cut_one_unflagged(
    channels,
):
    for name, recording in channels.items():
        cuts = count(recording, evenly(recording, 100))
        assert (name, cuts.lost, cuts.unflagged) == (name, (), ())


def test_presses_of_a_robot_after_a_grip_are_found_with_their_holds(real_data):
    path = real_data / "ur5_honeycomb/rigid_kpx_0.0017_2_trial4.bag"
    recording = read_recording(
        path, mapping={"hall": "/trial4.real_hall"}, units={"hall": "au"}
    )
    holds = np.array([1.37, 1.48, 1.43, 1.40, 1.39, 1.37, 1.36, 1.35, 1.35])
    for definition, held in (("plateau", slice(None)), ("auto", slice(1, None))):
        # The first press passes through a top: the user fixes what its height is.
        settings = PeakSettings(invert=True, height=definition)
        frame = measure_pushes(recording, settings=settings).frame
        assert len(frame) == 9
        assert set(frame["definition"][held]) == {"plateau"}
        np.testing.assert_allclose(
            frame["height_au"][held], holds[held], rtol=0, atol=CREEP
        )


def test_an_indenter_log_is_read_as_it_is(real_data):
    recording = read_recording(real_data / "indenter_ddf/1000 mN data file.ddf")
    frame = measure_pushes(recording, settings=PeakSettings(channel="AI1")).frame
    assert len(frame) == 1
    np.testing.assert_allclose(frame["height_n"], 0.9958, rtol=0, atol=DRIFT)


def test_a_poke_in_a_bare_log_is_found_once_and_read_at_its_hold(real_data):
    """It overshoots to 5.4 N, springs back to 1.4 N, and is then held."""
    recording = read_recording(
        real_data / "peg_poke/forcetorque-20+0.txt",
        columns=("fx_n", "fy_n", "fz_n", "..."),
        rate=125.0,
    )
    settings = PeakSettings(channel="fz", invert=True)
    frame = measure_pushes(recording, settings=settings).frame
    assert len(frame) == 1
    is_held = (recording.time > 7.45) & (recording.time < 7.95)
    hold = -np.median(recording.channels["fz"][is_held])
    assert frame["definition"].tolist() == ["plateau"]
    assert 7.45 < frame["t_peak_s"][0] < 7.95
    assert abs(frame["height_n"][0] - hold) < 2 * frame["height_sd_n"][0] < HELD


@SHAPES
@pytest.mark.parametrize("louder", [0.3, 3.0])
def test_noise_elsewhere_changes_no_low_push(shape, louder):
    """Feet that lie in noise are found by the noise of their own push."""
    time, y = simulated((15.0, 20.0, 17.0, 18.0), shape=shape)
    other = louder * np.random.default_rng(RNG + 1).standard_normal(2 * y.size)
    both = np.concatenate([y, other])
    whole = measured(time, y)
    assert len(whole) == 4
    assert_same(measured(np.arange(both.size) * 0.01, both)[:4], whole)
