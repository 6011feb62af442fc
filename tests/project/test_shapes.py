"""Annotations with their shapes are executed, but where a module is `repeated`."""

import jaxtyping
import numpy as np
import pytest

from pushfit.data.pushes.feet import likeness

TWO, THREE = np.zeros(2), np.zeros(3)


def test_shapes_are_checked():
    with pytest.raises(jaxtyping.TypeCheckError):
        likeness(TWO, THREE)


@pytest.mark.repeated
def test_shapes_are_not_checked_again_and_again():
    with pytest.raises(ValueError, match="could not be broadcast"):
        likeness(TWO, THREE)
