"""What is no argument of a public function is refused by name, value and next step."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import pushfit
from pushfit.arguments import checked
from pushfit.data.simulate import Session
from pushfit.errors import ConfigError
from pushfit.mechanics.ranges import check_numbers, check_together

FRAME = pd.DataFrame({"theta_deg": [30.0], "alpha_deg": [0.0], "height_n": [2.0]})
PARAMS = pushfit.Parameters(K_sn=600, K_dn=300, K_st=400, C_rr=0.5, C_d=0.25, L=0.025)
LONG_AND_SHORT = pushfit.Grasp(push_length=np.array([1e-3, 2e-3, 5e-3]))
GRASP = pushfit.Grasp(push_length=5e-3)
SIMULATE = partial(
    pushfit.simulate_table,
    PARAMS,
    GRASP,
    theta=np.radians([30.0, 60.0]),
    alpha=0.0,
    repeats=1,
)
RNG = np.random.default_rng(0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: pushfit.extract_peaks(FRAME, FRAME),
            ("extract_peaks: recording = a DataFrame: must be a Recording", "read_rec"),
        ),
        (
            lambda: pushfit.compare_models(FRAME),
            ("compare_models: table = a DataFrame: must be a PeakTable", "from_frame"),
        ),
        (
            lambda: pushfit.read_table(FRAME),
            ("read_table: path = a DataFrame: must be a str or a path",),
        ),
        (
            lambda: pushfit.merge_tables([FRAME]),
            ("merge_tables: tables[0] = a DataFrame: must be a PeakTable",),
        ),
        (
            lambda: pushfit.forward(GRASP, PARAMS, PARAMS),
            ("forward: params = a Grasp: must be a Parameters or a Contact",),
        ),
        (
            lambda: pushfit.Explorer(None, sigma="0.1"),
            ("Explorer: sigma = '0.1': must be a number or None",),
        ),
        (
            lambda: SIMULATE(noise=0.1, rng=0),
            ("simulate_table: rng = 0: must be a Generator", "numpy.random.default"),
        ),
        (
            lambda: SIMULATE(repeats=-1, noise=0.0, rng=RNG),
            ("repeats = -1: must be a whole number, 1 or above",),
        ),
        (
            lambda: pushfit.PushSchedule.planned(15.0, 0.0),
            ("PushSchedule: theta = 15: must be in radians", "numpy.radians"),
        ),
        (
            lambda: pushfit.Pushes(np.array([0.1, 15.0]), 0.0),
            ("Pushes: theta = 15: must be in radians", "numpy.radians"),
        ),
        (
            lambda: pushfit.Pushes(0.1, -90.0),
            ("Pushes: alpha = -90: must be in radians",),
        ),
        (
            lambda: pushfit.critical_angle(PARAMS, GRASP, 90.0),
            ("critical_angle: alpha = 90: must be in radians",),
        ),
        (
            lambda: pushfit.best_direction(PARAMS, GRASP, 0.2, reach=(1.0, 0.0)),
            ("best_direction: reach = (1, 0): must be (low, high)",),
        ),
        (
            lambda: pushfit.Grasp(push_length=5.0),
            ("Grasp: push_length = 5: must be above 0 and at most 1, in metres",),
        ),
        (
            lambda: pushfit.Grasp(push_length=np.array("0.005")),
            ("'0.005' is text: give a number",),
        ),
        (
            lambda: pushfit.Pushes(np.array(["0.1"]), 0.0),
            ("['0.1'] is text: give a number",),
        ),
        (
            lambda: check_numbers("noise", "0.1", low=0.0, high=1.0, rule="0 or above"),
            ("noise = '0.1': must be a number, 0 or above",),
        ),
        (
            lambda: Session(unit="furlong"),
            ("Session: unit = 'furlong': must be one of n, kpa, counts, au",),
        ),
        (
            lambda: pushfit.Grasp(push_length=-0.005),
            ("Grasp: push_length = -0.005: must be above 0",),
        ),
        (
            lambda: pushfit.Grasp(push_length=0.005, sharpness=0.5),
            ("Grasp: sharpness = 0.5: must be 1 or above", "math.inf"),
        ),
        (
            lambda: pushfit.Grasp(push_length=0.005, mechanics="tilted"),
            ('Grasp: mechanics = "tilted": must be "linear", "tilting"',),
        ),
        (lambda: Session(rate=0.0), ("Session: rate = 0: must be above 0",)),
        (
            lambda: Session(noise=-1.0),
            ("Session: noise = -1: must be finite, 0 or above",),
        ),
        (lambda: Session(level=math.nan), ("Session: level = nan: must be a finite",)),
        (lambda: Session(step=1.5), ("Session: step = 1.5: must be from 0 to 1",)),
        (
            lambda: Session(normal="z"),
            ("Session: normal = 'z': must be one of fx, fy, fz, -fx",),
        ),
        (
            lambda: pushfit.Grasp(push_length=None),  # type: ignore
            ("Grasp: push_length = None: must be a number or an array of numbers",),
        ),
        (
            lambda: pushfit.Grasp(push_length=0.005, preload="12"),  # type: ignore
            ("Grasp: preload = '12': must be a number",),
        ),
        (
            lambda: pushfit.critical_angle(PARAMS, GRASP, "90"),  # type: ignore
            ("critical_angle: alpha = '90': must be a number",),
        ),
        (
            lambda: pushfit.Pushes(np.zeros(2), np.zeros(3)),
            ("Pushes: shapes theta of (2,) and alpha of (3,) do not go together",),
        ),
        (
            lambda: pushfit.forward(
                PARAMS, pushfit.Pushes(np.zeros(2), 0.0), LONG_AND_SHORT
            ),
            ("forward: shapes theta of (2,) and push_length of (3,)", "one for all"),
        ),
        (
            lambda: check_together("plan", theta=0.0, a=np.ones(2), b=np.ones(3)),
            ("plan: shapes theta of () and a of (2,) and b of (3,)", "one for all"),
        ),
        (
            lambda: pushfit.read_recording("a.csv", columns="time_s,height_n"),
            ("read_recording: columns = 'time_s,height_n': must be a list of str",),
        ),
        (
            lambda: pushfit.identify_batch([FRAME], "out"),  # type: ignore
            ("identify_batch: inputs[0] = a DataFrame: must be a str or a path",),
        ),
        (
            lambda: pushfit.identify(FRAME, checkpoint=5),  # type: ignore
            ("identify: checkpoint = 5: must be a str or a path or None",),
        ),
        (
            lambda: pushfit.identify(FRAME, progress="a"),  # type: ignore
            ("identify: progress = 'a': must be a Callable or None",),
        ),
        (lambda: SIMULATE(noise=-0.1, rng=RNG), ("noise = -0.1: must be 0 or above",)),
        (lambda: SIMULATE(noise=np.ones(3), rng=RNG), ("noise = [1. 1. 1.]", "2 push")),
        (
            lambda: SIMULATE(noise=0.0, rng=RNG, channels=("hight",)),
            ("channels: hight is not known", "height_tangential"),
        ),
    ],
)
def test_a_wrong_argument_is_named_with_what_to_give(call, words):
    with pytest.raises(ConfigError) as raised:
        call()
    for part in words:
        assert part in str(raised.value)


@checked
def measured(
    names: str | Sequence[str | Path], widths: tuple[float, ...], n: float, k: int = 1
) -> int:
    """Any function."""
    return len(names) + len(widths) + int(n) + k


def test_a_list_will_do_for_a_tuple_and_numbers_of_numpy_for_those_of_python():
    found = measured(["one"], [1.0, 2.0], np.float32(3.0), k=np.int64(4))  # type: ignore
    assert found == 1 + 2 + 3 + 4


def test_elements_of_a_list_are_named_by_their_number():
    words = r"measured: names\[1\] = a DataFrame: must be a str or a path"
    with pytest.raises(ConfigError, match=words):
        measured(["one", FRAME], (), 3.0)  # type: ignore


def test_what_is_missing_is_said_by_python():
    with pytest.raises(TypeError, match=r"measured.*'n'"):
        measured("one", ())  # type: ignore


def test_an_unknown_argument_is_said_with_the_name_of_the_function():
    with pytest.raises(TypeError, match=r"measured.*'m'"):
        measured("one", (), 3.0, m=1)  # type: ignore
