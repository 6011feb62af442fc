"""Versions and platform on which numbers depend.

Excluded: all other packages (`pushfit.cli.commands.doctor`).
"""

import functools
import platform
from importlib.metadata import version

import numpy as np

PACKAGES = ("pushfit", "jax", "optimistix", "emcee", "numpy", "scipy", "pandas")


@functools.cache
def environment() -> dict[str, str]:
    """Versions and platform: where all agree, equal input gives equal bits.

    Returns:
        Versions of the packages that compute and of Python, and under "platform" the
        operating system and the instruction set for which loops are compiled.
    """
    # The order of a sum, and with it the last bit, follows the width of the vectors.
    features = np.show_config(mode="dicts") or {}
    extensions = features.get("SIMD Extensions", {}).get("found", [])
    machine = (platform.system(), platform.machine(), *extensions[-1:])
    return {
        **{name: version(name) for name in PACKAGES},
        "python": platform.python_version(),
        "platform": " ".join(machine),
    }
