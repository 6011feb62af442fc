"""A file as it should be, and the error of one that is not."""

import pytest

from pushfit.data.recordings.recording import read_recording
from pushfit.errors import PushfitError

GOOD = "time_s,pressure_kpa\n0.00,1.5\n0.01,1.25\n0.02,-3e-1\n"


def refusal(path, **options):
    with pytest.raises(PushfitError) as caught:
        read_recording(path, **options)
    return caught.value
