"""Simulated recordings of a sweep that the tests of peaks share."""

import dataclasses

import numpy as np

from pushfit.data.simulate import ALPHA_SWEEP, simulate_recording
from pushfit.model import Grasp, Parameters
from tests.problems import BIOTAC

PARAMS = Parameters(
    K_sn=800.0, K_dn=1500.0, K_st=400.0, C_rr=0.3, C_d=0.3, L=0.04, e1=0.3
)
COUNTS = Grasp(push_length=5e-3, gain=200.0)


def simulated(schedule=ALPHA_SWEEP, grasp=COUNTS, session=BIOTAC, seed=0, **changes):
    return simulate_recording(
        PARAMS,
        grasp,
        schedule,
        session=dataclasses.replace(session, **changes),
        rng=np.random.default_rng(seed),
    )


def with_signal(recording, change):
    channels = {name: change(y) for name, y in recording.channels.items()}
    return dataclasses.replace(recording, channels=channels)
