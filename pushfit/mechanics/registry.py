"""Mechanics by name: what each needs to be told, and where its functions are.

One record is all that the rest of the package knows of a mechanics. Excluded: the
functions themselves (`pushfit.mechanics`), so that settings are read without JAX.
"""

import functools
import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType, ModuleType
from typing import Any

# What a module that holds mechanics of one's own is called before their name.
PREFIX = "pushfit_"


@dataclass(frozen=True, slots=True)
class Deferred:
    """A function, named "module:function", that is imported when it is first called."""

    place: str

    def __call__(self, *args: object) -> Any:
        """What the function returns."""
        return pkgutil.resolve_name(self.place)(*args)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanics:
    """One way from parameters and a push to the forces at the contact.

    Functions take parameters or a `Contact`, and a grasp last or before directions.

    Args:
        title: What reports call its equations, in the plural.
        summary: What it is for, in the reference of `[grasp] mechanics`.
        forces: Contact forces of parameters, pushes and a grasp: JAX throughout.
        needs: What to say where a setting, "section.key", is not stated.
        critical_angle: θ_c of parameters, a grasp and azimuths [rad].
        ties: Value of a coordinate with which a push just does not roll, of a
            `Contact`, a grasp, and θ and α [rad]; first choice first.
        is_tie: Whether θ_c of a `Contact` and a grasp is the angle that `ties` were
            given [rad]; None where only `critical_angle` tells.
        sees_tilt: Whether forces depend on s = K_st L²/C_d and L, not on B alone.
        is_searched: Whether forces are themselves found by a search, so that a soft
            transition is slow to compile.
        has_length: Whether θ_c is quoted with the push length.
    """

    title: str
    summary: str
    forces: Callable[..., Any]
    needs: Mapping[str, str] = field(default_factory=dict)
    critical_angle: Callable[..., Any] = Deferred(
        "pushfit.mechanics.critical_by_search:searched_critical_angle"
    )
    ties: Mapping[str, Callable[..., Any]] = field(
        default_factory=lambda: {
            "ln_C_rr": Deferred(
                "pushfit.mechanics.critical_by_search:searched_critical_friction"
            )
        }
    )
    is_tie: Callable[..., Any] | None = None
    sees_tilt: bool = False
    is_searched: bool = False
    has_length: bool = True


BUILT_IN = MappingProxyType(
    {
        "linear": Mechanics(
            title="linear mechanics",
            summary="the equations of the paper, for small tilts",
            forces=Deferred("pushfit.mechanics.linear:linear_forces"),
            critical_angle=Deferred("pushfit.mechanics.linear:linear_critical_angle"),
            ties={
                "ln_B": Deferred("pushfit.mechanics.linear:critical_B"),
                "ln_C_rr": Deferred("pushfit.mechanics.linear:critical_C_rr"),
                "ln_A": Deferred("pushfit.mechanics.linear:critical_A"),
            },
            is_tie=Deferred("pushfit.mechanics.linear:is_upper_tie"),
            has_length=False,
        ),
        "tilting": Mechanics(
            title="tilting mechanics",
            summary="for pushes of millimetres, needs push.length_mm and parameters.L",
            forces=Deferred("pushfit.mechanics.tilting.two_supports:tilting_forces"),
            needs={
                "push.length_known": "the tilt depends on the push length; set "
                "push.length_mm",
                "parameters.L": "the tilt depends on L; measure it and set "
                "parameters.L, for example normal = { mean = 0.04, sd = 0.001 }",
            },
            critical_angle=Deferred(
                "pushfit.mechanics.tilting.critical_tilt:tilting_critical_angle"
            ),
            # Only C_rr follows from θ_c without a search: what the unrolled push needs.
            ties={
                "ln_C_rr": Deferred(
                    "pushfit.mechanics.tilting.critical_tilt:critical_friction"
                )
            },
            sees_tilt=True,
            is_searched=True,
        ),
    }
)
# What "auto" computes by, each where its needs are met; the first always can.
COMPARED = ("linear", "tilting")


@functools.cache
def mechanics_named(name: str) -> Mechanics:
    """The record of a mechanics.

    Args:
        name: A name of `BUILT_IN`, or of a module that holds a record `MECHANICS`:
            "hertz" is pushfit_hertz, or pushfit.mechanics.hertz.

    Raises:
        LookupError: There is none of that name.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]
    module = _module_of(name)
    if module is not None:
        return module.MECHANICS
    known = ", ".join(f'"{one}"' for one in BUILT_IN)
    raise LookupError(
        f"must be {known}, or the name of mechanics of your own, for which Python "
        f"finds no module {PREFIX}{name} with a record MECHANICS"
    )


def source_of(name: str) -> str | None:
    """File that mechanics of one's own are in; None for those of this package."""
    module = None if name == "auto" or name in BUILT_IN else _module_of(name)
    return None if module is None else module.__file__


def _module_of(name: str) -> ModuleType | None:
    """The module of mechanics of one's own, if Python finds it."""
    for place in (f"{PREFIX}{name}", f"pushfit.mechanics.{name}"):
        if name.isidentifier() and importlib.util.find_spec(place) is not None:
            module = importlib.import_module(place)
            if isinstance(getattr(module, "MECHANICS", None), Mechanics):
                return module
    return None


def has_foreign() -> bool:
    """Whether mechanics from outside the package may have been traced."""
    # At once: other threads import meanwhile.
    return any(name.startswith(PREFIX) for name in tuple(sys.modules))
