"""The `pushfit` command."""

from pushfit.cli.app import main

__all__ = ["main"]
