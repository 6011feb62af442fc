"""Priors as `[parameters.NAME]` states them, in SI or sensor units per metre.

Excluded: the densities of these priors (`pushfit.fit.problem.priors.distributions`).
"""

from collections.abc import Iterator
from typing import Any

from pydantic import Field, create_model, model_validator

from pushfit.config.section import Number, Positive, Section
from pushfit.parameters import PARAMETERS, Parameter

# Of an object in a hand [m].
LONGEST = 1.0


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
            raise ValueError(
                f"low = {self.low:g} must be below high = {self.high:g}; give the "
                "lower bound as low, or fixed for one value"
            )
        return self


class PriorSetting(Section):
    """What is known of a number: exactly one of a value or a distribution."""

    fixed: Number | None = None
    normal: Normal | None = None
    lognormal: Lognormal | None = None
    uniform: Uniform | None = None

    @model_validator(mode="after")
    def check_one_kind(self) -> "PriorSetting":
        """Refuse no statement, and two that could contradict each other."""
        kinds = [k for k in type(self).model_fields if getattr(self, k) is not None]
        if len(kinds) != 1:
            choice = ", ".join(type(self).model_fields)
            if not kinds:
                raise ValueError(
                    f"give exactly one of {choice}, or leave the whole parameter out"
                )
            given = " and ".join(kinds)
            raise ValueError(f"give exactly one of {choice}, not {given}; keep one")
        return self


class PositivePrior(PriorSetting):
    """What is known of a positive number."""

    @model_validator(mode="after")
    def check_sign(self) -> "PositivePrior":
        """Refuse values at or below zero where the physics has none."""
        if self.fixed is not None and self.fixed <= 0:
            raise ValueError(
                f"fixed = {self.fixed:g} must be above 0; give it above 0, or a "
                "distribution where it is not known"
            )
        if self.normal is not None and self.normal.mean <= 0:
            raise ValueError(
                f"mean = {self.normal.mean:g} must be above 0; give it above 0, or a "
                "lognormal, which has no values below"
            )
        if self.uniform is not None and self.uniform.low < 0:
            raise ValueError(
                f"low = {self.uniform.low:g} must not be below 0; give 0 or more"
            )
        return self


class LengthPrior(PositivePrior):
    """What is known of a length in an object that a hand holds."""

    @model_validator(mode="after")
    def check_size(self) -> "LengthPrior":
        """Refuse what must be in millimetres."""
        stated = {
            "fixed": self.fixed,
            "mean": self.normal and self.normal.mean,
            "median": self.lognormal and self.lognormal.median,
            "low": self.uniform and self.uniform.low,
        }
        for word, value in stated.items():
            if value and value > LONGEST:
                raise ValueError(
                    f"{word} = {value:g} m is no length in an object that a hand "
                    "holds; state it in metres, 40 mm as 0.04"
                )
        return self


class SignedPrior(PriorSetting):
    """What is known of a number of any sign."""

    @model_validator(mode="after")
    def check_kind(self) -> "SignedPrior":
        """Refuse the distribution that knows only positive numbers."""
        if self.lognormal is not None:
            raise ValueError("lognormal is for positive numbers; use normal or uniform")
        return self


def _key(parameter: Parameter) -> tuple[Any, Any]:
    kind = PositivePrior if parameter.is_positive else SignedPrior
    kind = LengthPrior if parameter.unit == "m" else kind
    unit = "-" if parameter.unit == "1" else parameter.unit
    description = f"{parameter.meaning} [{unit}]"
    return kind | None, Field(
        default=None, description=description, examples=[parameter.example]
    )


_keys: dict[str, Any] = {name: _key(p) for name, p in PARAMETERS.items()}
_Keys: Any = create_model("_Keys", __base__=Section, **_keys)


class ParametersSection(_Keys):
    """What is known beforehand of each parameter; absent: a default prior.

    Each takes one of fixed = value, normal = { mean, sd }, uniform = { low, high } and,
    where it is positive, lognormal = { median, sd_log }. Units are SI; where heights
    stay in sensor units, newtons become sensor units.
    """

    def items(self) -> Iterator[tuple[str, PriorSetting]]:
        """Name and prior of every parameter that the file mentions."""
        for name in type(self).model_fields:
            prior = getattr(self, name)
            if prior is not None:
                yield name, prior
