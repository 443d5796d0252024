"""URDF robots; placeholder of the reader."""

from __future__ import annotations

from pathlib import Path

from geometry import InputError, RobotModel


def read_urdf(path: Path, base: str, tip: str) -> RobotModel:
    """The chain from link ``base`` to link ``tip`` of a URDF file."""
    raise InputError(f"{path}: URDF robots are not read yet ({base} … {tip}); give [[joint]] tables")
