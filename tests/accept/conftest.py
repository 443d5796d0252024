"""The command line, run in this process."""

from tests.workbench.conftest import cli

__all__ = ["cli"]
