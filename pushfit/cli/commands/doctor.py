"""`pushfit doctor`: whether this installation computes, and with which versions.

Excluded: faults of input files, which `validate` finds (`pushfit.cli.commands.files`).
"""

import math
import platform
import re
from importlib import metadata

from pushfit.cli import options
from pushfit.cli.session import CommandSession
from pushfit.errors import FitError
from pushfit.fit.programs.folder import enable_compile_cache

SCHEMA = "pushfit.doctor/1"
# How metadata name the extras of those who work on pushfit.
FOR_DEVELOPERS = re.compile(r"extra == .(docs|bench|test)\b")
# Single precision would be off by 1e-7.
DOUBLE_PRECISION = 1e-14


def doctor(session: CommandSession, json: options.JsonOption = False) -> None:
    """Check the installation and list its versions."""
    cache = enable_compile_cache()
    check_arithmetic()
    facts = {
        "status": "ok",
        "python": platform.python_version(),
        "platform": platform.platform(),
        "compile_cache": cache,
    }
    versions = installed_versions()
    if json:
        session.answer({"schema": SCHEMA, **facts, "versions": versions})
        return
    for name, value in (facts | versions).items():
        print(f"{name:<20} {value or 'not installed'}")


def check_arithmetic() -> None:
    """Compare the model with Eq. (11) worked out by hand."""
    from pushfit.mechanics.directions import critical_angle
    from pushfit.model import Grasp, Parameters, as_float

    params = Parameters(K_sn=600.0, K_dn=300.0, K_st=400.0, C_rr=0.5, C_d=0.25, L=0.025)
    # A = 200 N/m and B = 200 N/m make tan θ_c = 2.
    found = float(critical_angle(params, Grasp(push_length=5e-3), as_float(0)))
    if not math.isclose(found, math.atan(2), rel_tol=DOUBLE_PRECISION):
        raise FitError(
            f"the critical angle of the built-in example is {found!r} instead of "
            f"{math.atan(2)!r}; reinstall with the versions of constraints.txt",
            code="arithmetic",
        )


def installed_versions() -> dict[str, str | None]:
    """Version of pushfit and of every package it can use; None where absent.

    What only developers of pushfit need is left out where it is absent.
    """
    versions = {"pushfit": _version("pushfit")}
    for requirement in metadata.requires("pushfit") or []:
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        version = _version(name)
        if version or not FOR_DEVELOPERS.search(requirement):
            versions[name] = version
    return versions


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
