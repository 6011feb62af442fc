"""Settings of an analysis: what `grasp.toml` may say."""

from pushfit.config.file import (
    Settings,
    as_config,
    config_of,
    parse_config,
    read_config,
    template,
)
from pushfit.config.parameters import Lognormal, Normal, PriorSetting, Uniform
from pushfit.config.schema import GraspConfig

__all__ = [
    "GraspConfig",
    "Lognormal",
    "Normal",
    "PriorSetting",
    "Settings",
    "Uniform",
    "as_config",
    "config_of",
    "parse_config",
    "read_config",
    "template",
]
