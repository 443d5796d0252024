"""Whether the views of a recording show what they are taken for, before anything is rendered."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from geometry import InputError
from perceptron_emu import check_scene, faces_in_sheet
from workbench.emulate.recording import Configuration, TrueCell, frame_scene
from workbench.files import Cell, Truth


def check_views(cell: Cell, true: TrueCell, configurations: Sequence[Configuration]) -> set[str]:
    """Names of the solids that the sheet meets in some view; InputError for a view in which no string can be seen."""
    met: set[str] = set()
    for configuration in configurations:
        scene = frame_scene(cell, true, configuration)
        try:
            check_scene(scene)
        except InputError as error:
            where = f"frame {configuration.frame} at location {configuration.location}"
            raise InputError(f"{where}: {error}") from None
        met |= {scene.solids[k].name for k in np.unique(faces_in_sheet(scene, cell.emulator).solid)}
    return met


def never_met(names: Iterable[str], met: set[str]) -> str:
    """One line about the parts of a scene that no view's sheet meets, "" where there are none."""
    missed = [name for name in names if name not in met]
    return f"the laser sheet meets {', '.join(missed)} in no frame: check frame, rotation_deg, translation_mm" * bool(
        missed
    )


def all_hidden(truth: Truth | None) -> str:
    """One line about the frames in which something hides every string, "" where there are none."""
    frames = truth.frames if truth else ()
    dark = [str(f.frame) for f in frames if f.points and not any(p.visible_fraction for p in f.points)]
    return f"frame {', '.join(dark)}: every string is hidden from the laser or the camera" * bool(dark)
