"""Sphere spacing error: the distance of two balls' centres against the certificate of the ball bar."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from extraction import Circle
from geometry import InputError, NoAnswerError
from workbench.accept.associated import Sphere3, fit_sphere, form_of
from workbench.accept.ball import BallStandard, form_figure, lost_notes, size_figure, standard_notes
from workbench.accept.figures import Limit, Rule
from workbench.accept.on_standard import Stretch, arcs, other_notes
from workbench.accept.record import Record, make_record
from workbench.accept.recorded import Progress, Recorded

Array = NDArray[np.float64]

STANDARD = "VDI/VDE 2634 part 2 (SD), ISO 10360-8 (length by two spheres)"
_PLACES = "seven positions of the ball bar in the measuring volume are asked for: one record speaks of the one measured"
_ROUNDS = 20


def accept_spacing(
    recorded: Recorded,
    ball: BallStandard,
    distance_mm: float,
    distance_uncertainty_mm: float | None = None,
    limits: Sequence[Limit] = (),
    rule: Rule = "conformity",
    zone_deg: float | None = None,
    remarks: Sequence[str] = (),
    progress: Progress | None = None,
) -> Record:
    """Sphere spacing error of two like balls.

    Parameters
    ----------
    recorded
        A scan across both balls.
    ball
        Either of them; their diameters by one certificate.
    distance_mm, distance_uncertainty_mm
        Of the centres by the certificate, with its expanded uncertainty (k = 2).
    limits, rule
        On SD, PF_first, PF_second, PS_first or PS_second, and what passes.
    zone_deg
        Points up to so far from each section's apex count.
    remarks
        The user's own words for the record.
    progress
        Told how many profiles are searched.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        Where the profiles' places are not told, or the distance can not be that of such balls.
    NoAnswerError
        Where both balls are not seen.

    """
    if distance_mm <= ball.diameter_mm:
        raise InputError(
            f"a distance of {distance_mm:g} mm between balls of {ball.diameter_mm:g} mm: they would overlap"
        )
    if not recorded.is_scan:
        raise InputError(
            "the spacing of spheres needs to be told where the sensor stood (--step-mm, --positions, or a cell): "
            "a single section does not tell a centre beside its sheet"
        )
    found, lost = arcs(recorded.profiles, (ball.diameter_mm, ball.diameter_mm), zone_deg, progress)
    clouds = _two_balls(found, distance_mm)
    forms = [form_of(cloud, fit_sphere) for cloud in clouds]
    one, two = (form.feature for form in forms)
    measured = float(np.linalg.norm(two.centre_mm - one.centre_mm))
    if not 0.5 < measured / distance_mm < 2:
        raise InputError(
            f"the balls' centres stand {measured:.4g} mm apart, the certificate says {distance_mm:g} mm: check "
            "--distance-mm and where the sensor stood"
        )
    words = "sphere spacing error: distance of the associated spheres' centres less the certificate's"
    figures = [size_figure("SD", measured - distance_mm, words, distance_uncertainty_mm)]
    for name, form in zip(("first", "second"), forms, strict=True):
        error = 2 * form.feature.radius_mm - ball.diameter_mm
        figures.append(form_figure(f"PF_{name}", form.range_mm, f"range about the {name} sphere", ball.form_mm))
        words = f"diameter of the {name} sphere less the certificate's"
        figures.append(size_figure(f"PS_{name}", error, words, ball.diameter_uncertainty_mm))
    details = {
        "distance_mm": distance_mm,
        "measured_distance_mm": measured,
        "moved_by": recorded.moved_by,
        "balls": [
            _ball(k, f.feature, len(f.used), f.rejected) for k, f in zip(("first", "second"), forms, strict=True)
        ],
    }
    notes = [*recorded.notes, f"the sensor was moved by {recorded.moved_by}; what that adds is in SD"]
    if distance_uncertainty_mm is None:
        notes.append("the uncertainty of the distance was not given: SD is judged without one")
    notes += standard_notes("the balls", ball.form_mm, ball.diameter_uncertainty_mm)
    notes += lost_notes(lost) + other_notes(found)
    return make_record(
        "spacing", f"sphere spacing error over {distance_mm:g} mm", STANDARD, figures, limits, rule, recorded.files,
        details=details, not_judged=[_PLACES], notes=notes, remarks=remarks,
    )  # fmt: skip


def _two_balls(found: Sequence[Stretch], distance_mm: float) -> tuple[Array, Array]:
    """The points of either ball: sections belong to the nearer of the two ends of all centres, then of the spheres."""
    if len(found) < 2:
        raise NoAnswerError("both balls must be seen, in sections across each")
    centres = np.array([s.of.in_scan(_centre(s))[0] for s in found])
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)
    i, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
    if apart[i, j] < distance_mm / 2:
        raise NoAnswerError(
            f"the sections' centres reach over {apart[i, j]:.3g} mm only, where two balls stand {distance_mm:g} mm "
            "apart: the second one was not seen"
        )
    nodes = centres[[min(i, j), max(i, j)]]
    mine = np.zeros(len(found), dtype=int)
    for _ in range(_ROUNDS):
        before = mine
        mine = np.argmin(np.linalg.norm(centres[:, None] - nodes, axis=2), axis=1)
        nodes = np.array([centres[mine == k].mean(axis=0) for k in (0, 1)])
        if np.array_equal(before, mine):
            break
    one, two = ([s.points_mm for s, k in zip(found, mine, strict=True) if k == own] for own in (0, 1))
    return np.vstack(one), np.vstack(two)


def _centre(stretch: Stretch) -> Array:
    curve = stretch.curve
    return np.asarray(curve.centre_mm if isinstance(curve, Circle) else curve.origin_mm)[None, :]


def _ball(name: str, sphere: Sphere3, points: int, rejected: int) -> dict[str, object]:
    x, y, z = sphere.centre_mm.tolist()
    return {
        "ball": name, "x_mm": x, "y_mm": y, "z_mm": z, "diameter_mm": 2 * sphere.radius_mm, "points": points,
        "rejected": rejected,
    }  # fmt: skip
