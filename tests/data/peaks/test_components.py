"""Force components: heights along and across the contact normal."""

import dataclasses

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.data.simulate import THETA_SWEEP, Session, simulate_recording
from pushfit.errors import ConfigError, DataError
from pushfit.model import Grasp, Parameters
from tests.tolerances import EXACT

PARAMS = Parameters(K_sn=800.0, K_dn=1500.0, K_st=400.0, C_rr=0.3, C_d=0.3, L=0.04)
PRELOADED = Grasp(push_length=5e-3, preload=1.0)
# 27 residuals exceed four standard deviations by chance once in 600 seeds.
MAX_PULL = 4.5
STEP = 0.01  # stretches begin and end at samples [s]
HELD = 1.0  # from the middle of a push until well before the jerk at its end [s]


@pytest.fixture(scope="module")
def made():
    return simulate_recording(
        PARAMS,
        PRELOADED,
        THETA_SWEEP,
        session=Session(forces=True, noise=0.01),
        rng=np.random.default_rng(0),
    )


@pytest.mark.parametrize("channel", ["height_normal", "height_tangential"])
def test_components_are_the_true_ones(made, channel):
    table = extract_peaks(
        made.recording, THETA_SWEEP, settings=PeakSettings(normal="fz")
    )
    assert table.channels == ("height_normal", "height_tangential")
    error = table.heights(channel) - np.asarray(getattr(made.truth, channel))
    assert np.abs(error / table.sd(channel)).max() < MAX_PULL


@pytest.mark.parametrize("normal", ["fz", "-fz"])
def test_each_component_has_its_own_height_at_its_own_sign(made, normal):
    """The table has their lengths along and across the normal."""
    sign = -1.0 if normal == "-fz" else 1.0
    channels = {**made.recording.channels, "fz": sign * made.recording.channels["fz"]}
    recording = dataclasses.replace(made.recording, channels=channels)
    table = extract_peaks(recording, THETA_SWEEP, settings=PeakSettings(normal=normal))
    (trace,) = table.traces
    found = {own.name: own.heights.height for own in trace.components}
    np.testing.assert_array_equal(found["fz"], sign * table.heights("height_normal"))
    across = np.asarray(made.truth.height_tangential)
    truth = {"fx": across * np.cos(made.alpha), "fy": across * np.sin(made.alpha)}
    limit = MAX_PULL * float(table.sd("height_tangential").max())
    for name, expected in truth.items():
        np.testing.assert_allclose(found[name], expected, rtol=0, atol=limit)


def test_noise_does_not_make_a_tangential_force():
    """Straight pushes have none; the length of noise alone has a median of 1.18 sd."""
    plan = PushSchedule.planned(np.pi / 2, 0.0, repeats=60)
    session = Session(forces=True, noise=0.05, angle_resolution=1e-9)
    made = simulate_recording(
        PARAMS,
        Grasp(push_length=5e-3),
        plan,
        session=session,
        rng=np.random.default_rng(1),
    )
    table = extract_peaks(made.recording, plan, settings=PeakSettings(normal="fz"))
    across = table.heights("height_tangential") / table.sd("height_tangential")
    # sqrt(1.18² - 1) = 0.62; the median of 60 scatters by 0.15.
    assert 0.2 < np.median(across) < 1.0


def test_a_normal_that_falls_on_pushing_is_turned(made):
    channels = {**made.recording.channels, "fz": -made.recording.channels["fz"]}
    turned = dataclasses.replace(made.recording, channels=channels)
    plain = extract_peaks(
        made.recording, THETA_SWEEP, settings=PeakSettings(normal="fz")
    )
    again = extract_peaks(turned, THETA_SWEEP, settings=PeakSettings(normal="-fz"))
    np.testing.assert_allclose(
        again.heights("height_normal"), plain.heights("height_normal"), rtol=EXACT
    )


def test_a_normal_that_is_not_there_is_refused(made):
    with pytest.raises(ConfigError, match="fx, fy, fz"):
        extract_peaks(made.recording, THETA_SWEEP, settings=PeakSettings(normal="f_n"))


def test_a_gap_in_one_component_does_not_shift_the_others(made):
    channels = dict(made.recording.channels)
    rest = made.recording.time < made.t_start[0] - 0.2
    channels["fx"] = (
        np.where(rest & (np.arange(rest.size) % 3 == 0), np.nan, 0.0) + (channels["fx"])
    )
    holed = dataclasses.replace(made.recording, channels=channels)
    settings = PeakSettings(normal="fz")
    whole = extract_peaks(made.recording, THETA_SWEEP, settings=settings)
    table = extract_peaks(holed, THETA_SWEEP, settings=settings)
    np.testing.assert_allclose(
        table.heights("height_normal"),
        whole.heights("height_normal"),
        atol=4 * float(whole.sd("height_normal").max()),
    )


def test_a_push_beyond_the_range_of_one_component_is_flagged(made):
    """The length of the force hides that one of its axes has ended."""
    fz = made.recording.channels["fz"]
    end = 0.6 * np.asarray(made.truth.height_normal).max() + np.median(fz[:100])
    channels = {**made.recording.channels, "fz": np.minimum(fz, end)}
    cut = dataclasses.replace(made.recording, channels=channels)
    table = extract_peaks(cut, THETA_SWEEP, settings=PeakSettings(normal="fz"))
    is_cut = np.asarray(made.truth.height_normal) > end - np.median(fz[:100])
    assert is_cut.any()
    flagged = np.array(["saturated" in words for words in table.flags])
    assert flagged[is_cut].all()
    assert not flagged[np.asarray(made.truth.height_normal) < 0.9 * end].any()


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("cut", ["fz", "all"])
def test_a_stated_limit_of_forces_is_believed(made, sign, cut):
    """That of all ends where their length does, which is no limit of a component."""
    forces = made.recording.channels
    length = np.linalg.norm(list(forces.values()), axis=0)
    end = {"fz": 0.6 * forces["fz"].max(), "all": 0.6 * length.max()}[cut]
    within = np.minimum(1.0, end / length)
    channels = {name: sign * own * within for name, own in forces.items()}
    if cut == "fz":
        channels = forces | {"fz": sign * np.minimum(forces["fz"], end)}
    recording = dataclasses.replace(made.recording, channels=channels)

    def n_cut(limit):
        settings = PeakSettings(normal="fz", limit=limit)
        table = extract_peaks(recording, THETA_SWEEP, settings=settings)
        return sum("saturated" in flags for flags in table.flags)

    assert n_cut(None) > 0
    assert n_cut(2.0 * end) == 0
    if cut == "fz":
        assert n_cut(end) > 0


def pushes_with_jerks(course, *, jerk=0.0, at=0.0, axis="fz", rate=100):
    """Four pushes of 5 N along and 2 N across, each with a jerk of 50 ms.

    Args:
        course: From the time since the begin of a push to a share of its height [s].
    """
    time = np.arange(26 * rate) / rate
    rng = np.random.default_rng(0)
    along, across = 0.05 * rng.standard_normal((2, time.size))
    forces = {"fx": across, "fz": along}
    for start in 2 + 6 * np.arange(4):
        forces["fz"] += 5 * course(time - start)
        forces["fx"] += 2 * course(time - start)
        for name in axis.split():
            forces[name] -= jerk * np.exp(-(((time - start - at) / 0.02) ** 2))
    recording = Recording(time=time, channels=forces, units={"fx": "n", "fz": "n"})
    return extract_peaks(
        recording,
        PushSchedule.planned(np.pi / 4, 0.0, repeats=4),
        settings=PeakSettings(normal="fz"),
    )


def held(since):
    return np.clip(since / 0.5, 0, 1) * np.clip((2.5 - since) / 0.5, 0, 1)


def pointed(since):
    return np.clip(1 - np.abs(since - 1.25) / 1.25, 0, 1)


@pytest.mark.parametrize("jerk", [-70.0, -12.0, 12.0, 70.0])
@pytest.mark.parametrize("at", [0.25, 0.8, 1.25, 2.52])
@pytest.mark.parametrize(("axis", "rate"), [("fz", 100), ("fx", 100), ("fz", 2000)])
def test_a_jerk_is_neither_a_push_nor_a_height(jerk, at, axis, rate):
    """On contact, in the hold or on retracting."""
    table = pushes_with_jerks(held, jerk=jerk, at=at, axis=axis, rate=rate)
    assert table.flags == (frozenset(),) * 4
    for channel, height in (("height_normal", 5.0), ("height_tangential", 2.0)):
        pull = (table.heights(channel) - height) / table.sd(channel)
        assert np.abs(pull).max() < MAX_PULL
    assert any("jerks far briefer" in caution for caution in table.cautions)


def test_a_jerk_of_two_components_is_told_once():
    table = pushes_with_jerks(held, jerk=70.0, at=2.52, axis="fx fz")
    (caution,) = (c for c in table.cautions if "jerks far briefer" in c)
    assert len(caution.partition(" at ")[2].split(", ")) == 4


@pytest.mark.parametrize("rate", [100, 2000])
def test_a_trace_keeps_a_jerk_and_says_which_samples_it_is(rate):
    """At 2 kHz it is thinned."""
    table = pushes_with_jerks(held, jerk=70.0, at=2.52, rate=rate)
    assert table.n_pushes == 4
    fx, fz = table.traces[0].components
    assert not fx.is_jerk.any()
    for start in 2 + 6 * np.arange(4):
        is_near = np.abs(fz.time - start - 2.52) < 0.02
        assert fz.signal[is_near].min() < -60.0
        assert fz.is_jerk[is_near].all()
        assert not fz.is_jerk[np.abs(fz.time - start - 1.25) < HELD].any()


def held_pushes():
    """Four pushes that raise one component and lower the other."""
    time = np.arange(2600) / 100
    noise = 0.01 * np.random.default_rng(0).standard_normal((2, time.size))
    humps = sum(held(time - start) for start in 2 + 6 * np.arange(4))
    channels = {"fx": -2 * humps + noise[0], "fz": 5 * humps + noise[1]}
    return Recording(time=time, channels=channels, units={"fx": "n", "fz": "n"})


def test_stretches_are_those_of_the_rows_of_the_table():
    """A hump that is left out is measured as well, and is no row."""
    plan = PushSchedule.planned(np.pi / 4, 0.0, repeats=3)
    settings = PeakSettings(normal="fz", exclude=((1.5, 5.5),))
    table = extract_peaks(held_pushes(), plan, settings=settings)
    for own in table.traces[0].components:
        middle = (own.heights.start + own.heights.end) / 2
        np.testing.assert_allclose(middle, [9.25, 15.25, 21.25], rtol=0, atol=STEP)
        assert (own.heights.start < table.frame["t_peak_s"]).all()
        assert (table.frame["t_peak_s"] < own.heights.end).all()


def test_a_part_of_a_recording_has_components_of_that_part():
    plan = PushSchedule.planned(np.pi / 4, 0.0, repeats=2)
    settings = PeakSettings(normal="fz", begin=6.0, end=18.0)
    (trace,) = extract_peaks(held_pushes(), plan, settings=settings).traces
    for own in trace.components:
        assert (own.time[0], own.time[-1]) == (6.0, 18.0)
        assert own.heights.height.size == 2


@pytest.mark.parametrize("axis", ["fz", "fx"])
def test_a_jerk_at_the_top_of_a_pointed_push_hides_it(axis):
    table = pushes_with_jerks(pointed, jerk=12.0, at=1.25, axis=axis)
    assert table.flags == (frozenset({"gap"}),) * 4


@pytest.mark.parametrize("width", [0.15, 0.3])
def test_a_short_push_is_no_jerk(width):
    table = pushes_with_jerks(lambda since: np.clip(1 - np.abs(since / width), 0, 1))
    assert table.n_pushes == 4
    assert not any("jerk" in caution for caution in table.cautions)


def counted_forces(levels, *, quantum=0.01, changes=None):
    """Held pushes in whole counts without noise; the third left no trace.

    Args:
        levels: Readings at rest of each component [N].
    """
    time = np.arange(3200) / 100
    starts = 2 + 6 * np.arange(5)
    humps = sum(held(time - start) for k, start in enumerate(starts) if k != 2)
    forces = {"fx": 2.0, "fy": -1.0, "fz": 5.0} | (changes or {})
    return Recording(
        time=time,
        channels={
            name: quantum * np.rint((level + forces[name] * humps) / quantum)
            for name, level in levels.items()
        },
        units=dict.fromkeys(levels, "n"),
    )


FIVE = PushSchedule.planned(np.pi / 4, 0.0, repeats=5)
TWO_COUNTS = 0.02  # of the readings [N]
LENIENT = PeakSettings(normal="fz", allow_missing=True)
# Besides what a mean of equal counts may be off by, their scatter over some 20 samples.
COUNTS = 0.05


@pytest.mark.parametrize("level", [0.0, 2.13], ids=["zero", "rounded"])
@pytest.mark.parametrize("names", ["fx fz", "fx fy fz"])
def test_a_missing_push_in_constant_readings_is_known_to_their_resolution(level, names):
    """Neither the change nor the scatter of constant readings tells of their noise."""
    # Ramps of 1 N in 50 samples pass through every count.
    steps = dict.fromkeys(names.split(), 1.0)
    levels = dict.fromkeys(steps, level)
    made = counted_forces(levels, quantum=0.02, changes=steps)
    table = extract_peaks(made, FIVE, settings=LENIENT)
    assert [k for k, words in enumerate(table.flags) if "missing" in words] == [2]
    # A mean of readings at the top, over the mean of the middle half of those at rest.
    expected = 0.02 / np.sqrt(12) * np.hypot(1, 1.09)
    for channel in table.channels:
        assert table.heights(channel)[2] == pytest.approx(0, abs=EXACT)
        assert table.sd(channel)[2] == pytest.approx(expected, rel=COUNTS)


def test_a_missing_push_is_as_doubtful_in_a_component_as_in_that_channel_alone():
    made = counted_forces({"fx": 2.13, "fz": -0.71}, quantum=0.1)
    table = extract_peaks(made, FIVE, settings=LENIENT)
    for name, channel in (("fz", "height_normal"), ("fx", "height_tangential")):
        alone = LENIENT.model_copy(update={"normal": None, "channel": name})
        sd = extract_peaks(made, FIVE, settings=alone).sd("height")[2]
        assert table.sd(channel)[2] == pytest.approx(sd, rel=COUNTS)


@pytest.mark.parametrize("still", ["fx", "fz"])
def test_a_force_that_never_changes_is_refused(still):
    made = counted_forces({"fx": 2.0, "fz": 7.0}, changes={still: 0.0})
    with pytest.raises(DataError, match=f"readings of {still} never change") as caught:
        extract_peaks(made, FIVE, settings=LENIENT)
    assert caught.value.code == "constant"


def test_one_of_two_forces_across_may_stay_as_it_is():
    levels = {"fx": 2.0, "fy": -1.0, "fz": 7.0}
    made = counted_forces(levels, changes={"fy": 0.0})
    table = extract_peaks(made, FIVE, settings=LENIENT)
    pushed = [0, 1, 3, 4]
    np.testing.assert_allclose(
        table.heights("height_tangential")[pushed], 2.0, rtol=0, atol=TWO_COUNTS
    )


@pytest.mark.parametrize("offset", [0.0, 0.01, 0.02, -0.3])
def test_a_force_that_stays_where_it_is_saturates_no_push(offset):
    """Sums of an offset that binary numbers do not hold differ by rounding."""
    session = Session(forces=True, noise=0.01, rate=50.0)
    rng = np.random.default_rng(0)
    made = simulate_recording(PARAMS, PRELOADED, THETA_SWEEP, session=session, rng=rng)
    still = np.full(made.recording.time.size, offset)
    channels = {**made.recording.channels, "fx": still}
    recording = dataclasses.replace(made.recording, channels=channels)
    table = extract_peaks(recording, THETA_SWEEP, settings=PeakSettings(normal="fz"))
    assert not any("saturated" in flags for flags in table.flags)
