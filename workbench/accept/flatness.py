"""Flatness error on a plane standard: the range about the associated plane, or straightness without places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry import NoAnswerError
from workbench.accept.associated import FEWEST_POINTS, REJECTED, fit_flat, form_of
from workbench.accept.ball import form_figure, lost_notes, standard_notes
from workbench.accept.figures import Figure, Limit, Rule
from workbench.accept.on_standard import other_notes, straights
from workbench.accept.record import Record, make_record
from workbench.accept.recorded import Progress, Recorded

STANDARD = "VDI/VDE 2634 part 2 (F), ISO 10360-8 (flat form, D95 %)"
_PLACES = (
    "six placements of the plane in the measuring volume are asked for: one record speaks of the one that was measured"
)
_ALONE = (
    "F of the plane: profiles without their places show straightness within the sheet alone; tell where the sensor "
    "stood (--step-mm, --positions, or a cell)"
)


def accept_flatness(
    recorded: Recorded,
    plane_form_mm: float | None = None,
    limits: Sequence[Limit] = (),
    rule: Rule = "conformity",
    remarks: Sequence[str] = (),
    progress: Progress | None = None,
) -> Record:
    """Flatness and straightness errors on a plane standard.

    Parameters
    ----------
    recorded
        Profiles of the plane; a scan where they are placed.
    plane_form_mm
        The standard's own flatness by its certificate.
    limits, rule
        On F, F_D95 or straightness, and what passes.
    remarks
        The user's own words for the record.
    progress
        Told how many profiles are searched.

    Returns
    -------
    Record

    Raises
    ------
    NoAnswerError
        Where no profile has a straight stretch, or a scan does not determine the plane.

    """
    found, lost = straights(recorded.profiles, progress)
    found = [s for s in found if len(s.yz_mm) >= FEWEST_POINTS]
    if not found:
        raise NoAnswerError(f"no profile shows the plane: {lost[0] if lost else 'too few points'}")
    lines = [(s, form_of(s.yz_mm, fit_flat)) for s in found]
    worst = max(lines, key=lambda pair: pair[1].range_mm)
    words = f"largest range about a profile's line, of {worst[0].of.name}"
    figures = [form_figure("straightness", worst[1].range_mm, words, plane_form_mm)]
    rows = [
        {
            "profile": s.of.name,
            "points": len(s.yz_mm),
            "rejected": form.rejected,
            "length_mm": float(np.ptp(s.yz_mm[:, 0])),
            "range_mm": form.range_mm,
            "rms_mm": form.rms_mm,
        }
        for s, form in lines
    ]
    details: dict[str, object] = {"moved_by": recorded.moved_by or None, "lines": rows}
    not_judged, notes = [_PLACES], list(recorded.notes)
    if recorded.is_scan:
        cloud = np.vstack([s.points_mm for s in found])
        form = form_of(cloud, fit_flat)
        figures += [
            form_figure("F", form.range_mm, "flatness error: range about the associated plane", plane_form_mm),
            form_figure("F_D95", form.shell_mm, "shell of 95 % of the points about it", plane_form_mm),
        ]
        details |= {"normal": form.feature.normal, "rms_mm": form.rms_mm, "n_points": len(cloud)}
        details |= {"n_rejected": form.rejected}
        notes.append(f"the sensor was moved by {recorded.moved_by}; what that adds is in F")
        notes.append(f"{form.rejected} of {len(cloud)} points rejected, as VDI/VDE 2634 allows ({100 * REJECTED:g} %)")
    else:
        figures += [Figure(name, None, "mm", "not told by profiles without their places") for name in ("F", "F_D95")]
        not_judged.append(_ALONE)
    notes += standard_notes("the plane", plane_form_mm, 0.0) + lost_notes(lost) + other_notes(found)
    return make_record(
        "flatness", "flatness error on a plane standard", STANDARD, figures, limits, rule, recorded.files,
        details=details, not_judged=not_judged, notes=notes, remarks=remarks,
    )  # fmt: skip
