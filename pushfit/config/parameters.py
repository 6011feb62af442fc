"""Priors as `[parameters.NAME]` states them, in SI or sensor units per metre."""

from collections.abc import Iterator

from pydantic import Field, model_validator

from pushfit.config.section import Number, Positive, Section


class Normal(Section):
    """Normal distribution."""

    mean: Number
    sd: Positive


class Lognormal(Section):
    """Distribution of a positive number whose logarithm is normal."""

    median: Positive
    sd_log: Positive


class Uniform(Section):
    """Equal density between two bounds."""

    low: Number
    high: Number

    @model_validator(mode="after")
    def check_order(self) -> "Uniform":
        """Refuse an empty range."""
        if self.low >= self.high:
            raise ValueError(f"low = {self.low:g} must be below high = {self.high:g}")
        return self


class Prior(Section):
    """What is known of a number: exactly one of a value or a distribution."""

    fixed: Number | None = None
    normal: Normal | None = None
    lognormal: Lognormal | None = None
    uniform: Uniform | None = None

    @model_validator(mode="after")
    def check_one_kind(self) -> "Prior":
        """Refuse no statement, and two that could contradict each other."""
        kinds = [k for k in type(self).model_fields if getattr(self, k) is not None]
        if len(kinds) != 1:
            choice = ", ".join(type(self).model_fields)
            found = " and ".join(kinds) or "nothing"
            raise ValueError(f"give exactly one of {choice}, not {found}")
        return self


class PositivePrior(Prior):
    """What is known of a positive number."""

    @model_validator(mode="after")
    def check_sign(self) -> "PositivePrior":
        """Refuse values at or below zero where the physics has none."""
        if self.fixed is not None and self.fixed <= 0:
            raise ValueError(f"fixed = {self.fixed:g} must be above 0")
        if self.normal is not None and self.normal.mean <= 0:
            raise ValueError(f"mean = {self.normal.mean:g} must be above 0")
        if self.uniform is not None and self.uniform.low < 0:
            raise ValueError(f"low = {self.uniform.low:g} must not be below 0")
        return self


class SignedPrior(Prior):
    """What is known of a number of any sign."""

    @model_validator(mode="after")
    def check_kind(self) -> "SignedPrior":
        """Refuse the distribution that knows only positive numbers."""
        if self.lognormal is not None:
            raise ValueError("lognormal is for positive numbers; use normal or uniform")
        return self


class ParametersSection(Section):
    """What is known beforehand of each parameter; absent: a default prior.

    Each takes one of fixed = value, normal = { mean, sd }, uniform = { low, high } and,
    where it is positive, lognormal = { median, sd_log }. Units are SI; where heights
    stay in sensor units, newtons become sensor units.
    """

    K_sn: PositivePrior | None = Field(
        default=None,
        description="normal stiffness of the support finger [N/m]",
        examples=[{"lognormal": {"median": 800.0, "sd_log": 0.5}}],
    )
    K_dn: PositivePrior | None = Field(
        default=None,
        description="normal stiffness of the contact [N/m]",
        examples=[{"normal": {"mean": 1500.0, "sd": 300.0}}],
    )
    K_st: PositivePrior | None = Field(
        default=None,
        description="tangential stiffness of the support finger [N/m]",
        examples=[{"normal": {"mean": 400.0, "sd": 40.0}}],
    )
    C_rr: PositivePrior | None = Field(
        default=None,
        description="rolling friction coefficient [-]",
        examples=[{"uniform": {"low": 0.0, "high": 1.0}}],
    )
    C_d: PositivePrior | None = Field(
        default=None,
        description="rotational deformation coefficient [N·m/rad]",
        examples=[{"lognormal": {"median": 0.2, "sd_log": 1.0}}],
    )
    L: PositivePrior | None = Field(
        default=None,
        description="distance between the push contact and the support contact [m]",
        examples=[{"fixed": 0.04}],
    )
    e1: SignedPrior | None = Field(
        default=None,
        description="log ratio of the support's tangential axes, part along x [-]",
        examples=[{"normal": {"mean": 0.0, "sd": 0.5}}],
    )
    e2: SignedPrior | None = Field(
        default=None,
        description="log ratio of the support's tangential axes, part at 45 deg [-]",
        examples=[{"fixed": 0.0}],
    )
    F_0: PositivePrior | None = Field(
        default=None,
        description="preload [N], where it is estimated",
        examples=[{"lognormal": {"median": 2.0, "sd_log": 0.5}}],
    )
    p: PositivePrior | None = Field(
        default=None,
        description="sharpness of the transition [-], where it is unknown",
        examples=[{"lognormal": {"median": 8.0, "sd_log": 1.0}}],
    )

    def items(self) -> Iterator[tuple[str, Prior]]:
        """Name and prior of every parameter that the file mentions."""
        for name in type(self).model_fields:
            prior = getattr(self, name)
            if prior is not None:
                yield name, prior
