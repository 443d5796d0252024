"""The points of one image as CSV, in the columns of the commands."""

from __future__ import annotations

from dataclasses import replace

from extraction import peaks_text, profile_text
from geometry import Frame, InputError
from workbench.cell import rows
from workbench.files import points_text
from workbench.window.engine import ImageAnswer


def points_csv(outcome: ImageAnswer, number: int) -> str:
    """As `extract --csv` has strings, `profile --csv` a stripe.

    Parameters
    ----------
    outcome
        Of one image.
    number
        Of its frame.

    Returns
    -------
    str
        The file's text.

    Raises
    ------
    InputError
        Where there is nothing to be written.

    """
    view = outcome.profile
    if outcome.view is not None:
        frame = Frame(number, "", points=outcome.view.points)
        if outcome.labels is not None:
            frame = replace(frame, axis=outcome.labels.axis)
        return points_text(rows([frame]))
    if view is not None and view.profile is not None:
        return profile_text(view.profile)
    if view is not None and view.peaks is not None:
        return peaks_text(view.peaks)
    raise InputError("there are no points in this image")
