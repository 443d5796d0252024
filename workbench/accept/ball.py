"""Probing errors on a ball: form and size of the associated sphere, or of sections where no places are told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from extraction import Circle
from geometry import InputError, NoAnswerError
from workbench.accept.associated import FEWEST_POINTS, REJECTED, Form, fit_circle, fit_sphere, form_of
from workbench.accept.figures import Figure, Limit, Rule, gaussian_bounds
from workbench.accept.on_standard import Stretch, arcs, other_notes
from workbench.accept.record import Record, make_record
from workbench.accept.recorded import Progress, Recorded

STANDARD = "VDI/VDE 2634 part 2 (PF, PS), ISO 10360-8 (form D95 %, size of all points)"
_WHOLE_BALL = (
    "the probing form of 25 points (1x25 of ISO 10360-8) asks for points all over a hemisphere: a line sensor sees a "
    "band of it from one side; PF is of that band"
)
_SIZE = "probing error of size: diameter of the associated sphere less the certificate's"
_PLACES = "ten places in the measuring volume are asked for: one record speaks of the place that was measured"
_SECTION_SIZE = (
    "PS: a single section does not tell the ball's size, for nobody knows how far beside the centre the sheet cuts; "
    "tell where the sensor stood (--step-mm, --positions, or a cell)"
)
_SECTION_FORM = (
    "PF of the sphere: sections are judged one by one, which does not see what moves them against each other"
)


@dataclass(frozen=True)
class BallStandard:
    """A ball by its certificate: diameter with expanded uncertainty (k = 2), form deviation; None: not stated."""

    diameter_mm: float
    diameter_uncertainty_mm: float | None = None
    form_mm: float | None = None


def form_figure(name: str, value: float, words: str, own_form_mm: float | None) -> Figure:
    """A form error with the uncertainty of the standard's own form (ISO/TS 23165): u = F / 2."""
    bounds = None if own_form_mm is None else gaussian_bounds(value, own_form_mm / 2)
    return Figure(name, value, "mm", words, bounds)


def size_figure(name: str, value: float, words: str, uncertainty_mm: float | None) -> Figure:
    """An error of size with the uncertainty of the standard's certificate, stated with k = 2."""
    bounds = None if uncertainty_mm is None else gaussian_bounds(value, uncertainty_mm / 2)
    return Figure(name, value, "mm", words, bounds, signed=True)


def accept_ball(
    recorded: Recorded,
    ball: BallStandard,
    limits: Sequence[Limit] = (),
    rule: Rule = "conformity",
    zone_deg: float | None = None,
    remarks: Sequence[str] = (),
    progress: Progress | None = None,
) -> Record:
    """Probing error of form and size on a ball.

    Parameters
    ----------
    recorded
        Profiles across the ball; a scan where they are placed.
    ball
        The standard.
    limits, rule
        On PF, PS, PF_D95 or PF_section, and what passes.
    zone_deg
        Points up to so far from each section's apex count; None: all between the ends of the arc that is found.
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
        Where no profile shows the ball, or a scan does not determine the sphere.

    """
    found, lost = arcs(recorded.profiles, (ball.diameter_mm,), zone_deg, progress)
    if not found:
        raise NoAnswerError(f"no profile shows the ball: {lost[0]}")
    sections = [s for s in found if len(s.yz_mm) >= FEWEST_POINTS]
    if not sections:
        raise NoAnswerError(f"no section has the {FEWEST_POINTS} points that a test needs on the ball")
    per_section = [(s, form_of(s.yz_mm, fit_circle)) for s in sections]
    worst = max(per_section, key=lambda pair: pair[1].range_mm)
    words = f"largest range about a section's circle, of {worst[0].of.name}"
    figures = [form_figure("PF_section", worst[1].range_mm, words, ball.form_mm)]
    not_judged, notes = [_PLACES], list(recorded.notes)
    details: dict[str, object] = {
        "diameter_mm": ball.diameter_mm,
        "moved_by": recorded.moved_by or None,
        "sections": [_section(s, form) for s, form in per_section],
    }
    if recorded.is_scan:
        cloud = np.vstack([s.points_mm for s in found])
        form = form_of(cloud, fit_sphere)
        sphere = form.feature
        error = 2 * sphere.radius_mm - ball.diameter_mm
        figures += [
            form_figure("PF", form.range_mm, "probing error of form: range about the associated sphere", ball.form_mm),
            form_figure("PF_D95", form.shell_mm, "shell of 95 % of the points about it", ball.form_mm),
            size_figure("PS", error, _SIZE, ball.diameter_uncertainty_mm),
        ]
        details |= {
            "measured_diameter_mm": 2 * sphere.radius_mm,
            "centre_mm": sphere.centre_mm,
            "rms_mm": form.rms_mm,
            "n_points": len(cloud),
            "n_rejected": form.rejected,
        }
        not_judged.append(_WHOLE_BALL)
        notes.append(f"the sensor was moved by {recorded.moved_by}; what that adds is in PF and PS")
        notes.append(f"{form.rejected} of {len(cloud)} points rejected, as VDI/VDE 2634 allows ({100 * REJECTED:g} %)")
    else:
        figures += [
            Figure(name, None, "mm", "not told by sections without their places") for name in ("PF", "PF_D95", "PS")
        ]
        not_judged += [_SECTION_SIZE, _SECTION_FORM]
    notes += standard_notes("the ball", ball.form_mm, ball.diameter_uncertainty_mm if recorded.is_scan else 0.0)
    notes += lost_notes(lost) + other_notes(found)
    _check_size(details, ball)
    return make_record(
        "ball", f"probing error on a ball of {ball.diameter_mm:g} mm", STANDARD, figures, limits, rule, recorded.files,
        details=details, not_judged=not_judged, notes=notes, remarks=remarks,
    )  # fmt: skip


def standard_notes(what: str, form_mm: float | None, size_uncertainty_mm: float | None) -> list[str]:
    """What of the standard's certificate was not given."""
    notes = []
    if form_mm is None:
        notes.append(f"the own form of {what} was not given: form is judged without an uncertainty")
    if size_uncertainty_mm is None:
        notes.append(f"the uncertainty of the size of {what} was not given: size is judged without one")
    return notes


def lost_notes(lost: Sequence[str]) -> list[str]:
    """What profiles were left out, and why the first was."""
    if not lost:
        return []
    return [f"{len(lost)} profile{'s' * (len(lost) > 1)} left out: {lost[0]}{' …' * (len(lost) > 1)}"]


def _section(stretch: Stretch, form: Form[Circle]) -> dict[str, object]:
    return {
        "profile": stretch.of.name,
        "points": len(stretch.yz_mm),
        "rejected": form.rejected,
        "range_mm": form.range_mm,
        "rms_mm": form.rms_mm,
        "section_diameter_mm": 2 * form.feature.radius_mm,
    }


def _check_size(details: dict[str, object], ball: BallStandard) -> None:
    measured = details.get("measured_diameter_mm")
    if isinstance(measured, float) and not 0.8 < measured / ball.diameter_mm < 1.25:
        raise InputError(
            f"the sphere through the points has a diameter of {measured:.4g} mm, the standard {ball.diameter_mm:g} mm: "
            "check --diameter-mm and where the sensor stood"
        )
