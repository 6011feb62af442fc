"""The quantities of the model by name: letter, unit, meaning, default prior, once.

A record here is all that configuration, priors, results, tables, pages and figures know
of a parameter. Excluded: where it enters the forces (`pushfit.mechanics`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, TypeVar

# Period of an axis: pushing along α and along α + 180° is the same line [deg].
HALF_TURN = 180.0
# Stands for 0 below a fraction or in a log, so that neither is infinite: less than is
# measured in any unit, and above the least number that is not flushed to 0, 2e-308, by
# so much that 1e7 over it is finite.
TINY = 1e-300
# Unit of what a sensor reads: newton, kilopascal, counts, or an arbitrary one.
SensorUnit = Literal["n", "kpa", "counts", "au"]
# Kind, first and second number of a distribution.
Shape = tuple[str, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Named:
    """A quantity as reports, tables and figures name it.

    Args:
        name: Stable name, in files and in code.
        math: The letter as mathtext.
        unit: SI unit, "1" for a pure number, "deg" for an angle.
        meaning: What a reader who hovers over the letter is told.
        prose: The letter in running text; that of its name unless stated.
        is_stiffness: Whether it is proportional to the unit of force, and to the
            unknown where the push length is unknown.
    """

    name: str
    math: str
    unit: str
    meaning: str
    prose: str = ""
    is_stiffness: bool = False

    def __post_init__(self) -> None:
        """Fill in the letter."""
        object.__setattr__(self, "prose", self.prose or self.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter(Named):
    """A quantity that may be fixed, or have a prior.

    Args:
        prior: Default prior; None where only the table can say.
        example: What the reference of the configuration shows.
        is_positive: Whether it is positive, and so sampled in its log.
        grasp_field: Field of a `Grasp` that it sets; empty for one of `Parameters`.
    """

    prior: Shape | None
    example: Mapping[str, float | Mapping[str, float]] = field(hash=False)
    is_positive: bool = True
    grasp_field: str = ""


T = TypeVar("T", bound=Named)


def _by_name(*records: T) -> Mapping[str, T]:
    return MappingProxyType({record.name: record for record in records})


# Wide, for fingers and hand-held boxes: the medians are those of a compliant finger and
# put θ_c near the middle of its range; 0.8 in the log spans a factor 14 between the 5 %
# and 95 % points, 0.3 a factor 2.7. Of the sharpness, 5 % lie below 1.5 and above 41.
PARAMETERS = _by_name(
    Parameter(
        name="K_sn",
        math=r"$K_{sn}$",
        unit="N/m",
        meaning="normal stiffness of the support finger",
        is_stiffness=True,
        prior=("lognormal", 800.0, 0.8),
        example={"lognormal": {"median": 800.0, "sd_log": 0.5}},
    ),
    Parameter(
        name="K_dn",
        math=r"$K_{dn}$",
        unit="N/m",
        meaning="normal stiffness of the contact",
        is_stiffness=True,
        prior=("lognormal", 2000.0, 0.8),
        example={"normal": {"mean": 1500.0, "sd": 300.0}},
    ),
    Parameter(
        name="K_st",
        math=r"$K_{st}$",
        unit="N/m",
        meaning="tangential stiffness of the support finger",
        is_stiffness=True,
        prior=("lognormal", 400.0, 0.8),
        example={"normal": {"mean": 400.0, "sd": 40.0}},
    ),
    Parameter(
        name="C_rr",
        math=r"$C_{rr}$",
        unit="1",
        meaning="rolling friction coefficient",
        prior=("lognormal", 0.3, 0.8),
        example={"uniform": {"low": 0.0, "high": 1.0}},
    ),
    Parameter(
        name="C_d",
        math=r"$C_d$",
        unit="N·m/rad",
        meaning="rotational deformation coefficient: torque over tilt",
        is_stiffness=True,
        prior=("lognormal", 0.5, 0.8),
        example={"lognormal": {"median": 0.2, "sd_log": 1.0}},
    ),
    Parameter(
        name="L",
        math=r"$L$",
        unit="m",
        meaning="distance between the pushing and the supporting contact",
        prior=("lognormal", 0.04, 0.3),
        example={"fixed": 0.04},
    ),
    Parameter(
        name="e1",
        math=r"$e_1$",
        unit="1",
        meaning="ellipse of K_st: logarithm of its stretch along x against y",
        prior=("normal", 0.0, 1.0),
        example={"normal": {"mean": 0.0, "sd": 0.5}},
        is_positive=False,
    ),
    Parameter(
        name="e2",
        math=r"$e_2$",
        unit="1",
        meaning="ellipse of K_st: the same along the diagonals",
        prior=("normal", 0.0, 1.0),
        example={"fixed": 0.0},
        is_positive=False,
    ),
    Parameter(
        name="F_0",
        math=r"$F_0$",
        unit="N",
        meaning="preload of the grasp",
        prior=None,
        example={"lognormal": {"median": 2.0, "sd_log": 0.5}},
        grasp_field="preload",
    ),
    Parameter(
        name="p",
        math=r"$p$",
        unit="1",
        meaning="sharpness of the transition from rolling to elastic",
        prior=("lognormal", 8.0, 1.0),
        example={"lognormal": {"median": 8.0, "sd_log": 1.0}},
        grasp_field="sharpness",
    ),
)
# What heights say of the parameters together, and the two angles that are asked for.
COMBINATIONS = _by_name(
    Named(
        name="A",
        math=r"$A$",
        unit="N/m",
        meaning="normal stiffness that the heights meet: K_sn and K_dn in series",
        is_stiffness=True,
    ),
    Named(
        name="B",
        math=r"$B$",
        unit="N/m",
        meaning="tangential stiffness that the heights meet while nothing rolls",
        is_stiffness=True,
    ),
    Named(
        name="f1",
        math=r"$f_1$",
        unit="1",
        meaning="ellipse of B: logarithm of its stretch along x against y",
    ),
    Named(
        name="f2",
        math=r"$f_2$",
        unit="1",
        meaning="ellipse of B: the same along the diagonals",
    ),
)
ANGLES = _by_name(
    Named(
        name="theta_c",
        prose="θ_c",
        math=r"$\theta_c$",
        unit="deg",
        meaning="critical angle: pushes below it make the object roll",
    ),
    Named(
        name="alpha_star",
        prose="α*",
        math=r"$\alpha^*$",
        unit="deg",
        meaning="best push direction: the azimuth that resists least",
    ),
)
NAMED: Mapping[str, Named] = MappingProxyType({**PARAMETERS, **COMBINATIONS, **ANGLES})

# The noise of heights, with the channel at its end where there are several.
NOISE = "sigma_height"

# Numbers of the grasp that may be unknown, and its fields.
OF_GRASP = {p.name: p.grasp_field for p in PARAMETERS.values() if p.grasp_field}
POSITIVE = tuple(p.name for p in PARAMETERS.values() if p.is_positive)
SIGNED = tuple(p.name for p in PARAMETERS.values() if not p.is_positive)
# The six of the paper.
SIX = tuple(name for name in POSITIVE if name not in OF_GRASP)
# Those among the six that are proportional to the unit of force.
STIFF = tuple(name for name in SIX if PARAMETERS[name].is_stiffness)
STIFFNESSES = frozenset(q.name for q in NAMED.values() if q.is_stiffness)


def named(name: str) -> Named | None:
    """Record of a quantity, also of the noise of a channel; None for any other word."""
    if not name.startswith(NOISE):
        return NAMED.get(name)
    channel = name.removeprefix(NOISE).lstrip("_")
    if channel and not channel.isidentifier():
        return None
    index = rf"_{{\mathrm{{{channel.replace('_', ' ')}}}}}" if channel else ""
    return Named(
        name=name,
        prose=f"σ_{channel}" if channel else "σ",
        math=rf"$\sigma{index}$",
        unit="N",
        meaning="noise of a height",
    )


def unit_of(name: str, newton: str) -> str:
    """Unit of a quantity, with a word for N where the unit of force is not known."""
    return NAMED[name].unit.replace("N", newton)
