"""Settings of an analysis: what `grasp.toml` may say."""

from pushfit.config.file import config_of, parse_config, read_config, template
from pushfit.config.parameters import Lognormal, Normal, PriorSetting, Uniform
from pushfit.config.schema import GraspConfig

__all__ = [
    "GraspConfig",
    "Lognormal",
    "Normal",
    "PriorSetting",
    "Uniform",
    "config_of",
    "parse_config",
    "read_config",
    "template",
]
