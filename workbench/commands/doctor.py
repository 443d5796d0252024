"""Check the installation."""

from __future__ import annotations


def command() -> None:
    """Check the installation and say what is missing and how to get it."""
