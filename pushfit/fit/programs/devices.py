"""Whether JAX can compute here, as its environment variables tell it to.

Excluded: the programs that run then (`pushfit.fit.programs.compile`).
"""

import os

import jax

from pushfit.errors import ConfigError

# What JAX reads when it is imported.
NOT_COMPILED, PLATFORMS = "JAX_DISABLE_JIT", "JAX_PLATFORMS"


def check_devices() -> None:
    """Refuse an environment in which nothing can be computed.

    Raises:
        ConfigError: JAX may not compile, or has no device of the kinds that it is told
            to use.
    """
    if jax.config.jax_disable_jit:  # pyright: ignore
        raise ConfigError(
            f"{NOT_COMPILED} = {os.environ.get(NOT_COMPILED, True)}: nothing may be "
            "compiled, and an analysis is made of compiled programs; unset it",
            code="jax_disable_jit",
        )
    platforms = jax.config.jax_platforms  # pyright: ignore
    if not platforms:
        return
    try:
        jax.devices()
    # Of one that it knows and lacks, such as a GPU, JAX only asserts that it is there.
    except (AssertionError, RuntimeError) as error:
        raise ConfigError(
            f"{PLATFORMS} = {platforms}: JAX finds no such device here; unset it, or "
            "set it to cpu",
            code="jax_platforms",
        ) from error
