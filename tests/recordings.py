"""Recordings too large for the repository: where they lie on this machine, if they do.

cell_a is the whole of assets/samples/cell_a (28 frames); socket_closure holds the joint readings of
github.com/platonics-delft/kinematics_calibration. Tests that want them are skipped without.
"""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "PERCEPTRON_EMU_DATA"
MISSING = f"needs a recording that is not in the repository: set {VARIABLE} to the folder that holds it"


def recording(name: str) -> Path:
    """Where a recording is, or would be: below $PERCEPTRON_EMU_DATA, else in a `data` next to the checkout."""
    stated = os.environ.get(VARIABLE)
    folders = [Path(stated)] if stated else sorted(Path(__file__).resolve().parents[2].glob("*/data"))
    found = [folder / name for folder in folders if (folder / name).exists()]
    return found[0] if found else Path(VARIABLE) / name
