"""What is said of a sensor's calibration at both sides of each limit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calib.sensor.verdict import boards_parallel, judge, no_camera, too_few
from geometry import Pose, stack_poses

GOOD: dict[str, Any] = {
    "views": 10, "soft": 3, "stripes": 10, "tilt_deg": 30.0, "plane_deg": 0.05, "focal_share": 0.004, "corner_px": 0.2,
    "converged": True, "contradicted": False, "apart_px": 0.1,
}  # fmt: skip


def _verdict(**changed: Any) -> Any:
    """Of calibrations that are as good as they say: the plane's two turns are its 3/5 and 4/5."""
    g = SimpleNamespace(**GOOD | changed)
    views = [SimpleNamespace(soft=k < g.soft) for k in range(g.views)]
    residual = np.full((50, 2), g.corner_px / np.sqrt(2))
    sigma = {
        "plane_tilt_y_rad": 0.6 * np.deg2rad(g.plane_deg), "plane_tilt_z_rad": 0.8 * np.deg2rad(g.plane_deg),
        "fx_px": 1200 * g.focal_share,
    }  # fmt: skip
    choice = SimpleNamespace(
        bundle=SimpleNamespace(
            views=_Views(views),
            corner_term=SimpleNamespace(errors=lambda _state: SimpleNamespace(residual=residual)),
        ),
        result=SimpleNamespace(converged=g.converged, state=None),
        left_out=SimpleNamespace(stripe_count=np.array([7] * g.stripes + [0] * 3), plane_rms_mm=0.01234),
    )
    tilts = [Pose.from_fixed_xyz_deg([0, 0, 0], [0, 0, 400])]
    tilts += [Pose.from_fixed_xyz_deg([s * g.tilt_deg / 2, 0, 0], [0, 0, 400]) for s in (-1, 1)]
    solution = SimpleNamespace(
        uncertainty=SimpleNamespace(sigma=sigma), camera=np.array([1200.0]), boards=stack_poses(tilts)
    )
    return judge(choice, solution, 12, contradicted=g.contradicted, stripes_apart_px=g.apart_px)  # type: ignore[arg-type]


class _Views:
    def __init__(self, views: list[SimpleNamespace]) -> None:
        self.views = views

    def __len__(self) -> int:
        return len(self.views)


@pytest.mark.parametrize(
    ("key", "within", "beyond", "code"),
    [
        ("contradicted", False, True, "outliers"),
        ("tilt_deg", 8.001, 7.999, "boards_parallel"),
        ("converged", True, False, "not_converged"),
        ("focal_share", 0.004, np.nan, "not_converged"),
        ("stripes", 4, 1, "plane_not_determined"),
        ("plane_deg", 0.09, 2.001, "plane_not_determined"),
        ("corner_px", 1.0, 1.001, "model_misfit"),
        ("soft", 3, 4, "weak"),
        ("views", 5, 4, "weak"),
        ("focal_share", 0.005, 0.00501, "weak"),
        ("plane_deg", 0.0999, 0.1001, "weak"),
        ("apart_px", 1.0, 1.001, "weak"),
    ],
)
def test_a_limit_divides_ok_from_what_is_said_beyond_it(key: str, within: Any, beyond: Any, code: str) -> None:
    soft = {} if key == "soft" else {"soft": 0}
    assert _verdict(**soft | {key: within}).code == "ok"
    assert _verdict(**soft | {key: beyond}).code == code


def test_two_or_three_stripes_are_held_to_less_and_blamed_together() -> None:
    """A plane follows the two or three stripes that it is fitted to: a third of what they are off is seen."""
    assert _verdict(stripes=3, apart_px=0.3).code == "ok"
    found = _verdict(stripes=3, apart_px=0.3001)
    assert found.code == "outliers"
    assert "0.30 px apart beyond their noise" in found.text
    assert "; 3 do not tell which: record ten or more" in found.text
    assert _verdict(stripes=2).code == "ok"
    assert _verdict(plane_deg=2.0).code == "weak"


def test_the_gravest_is_said_first_and_all_that_is_weak_together() -> None:
    bad: dict[str, Any] = {
        "contradicted": True, "tilt_deg": 5.0, "converged": False, "stripes": 1, "apart_px": 3.0, "corner_px": 2.0,
        "soft": 4, "views": 4, "focal_share": 0.0123, "plane_deg": 0.456,
    }  # fmt: skip
    order = ["outliers", "boards_parallel", "not_converged", "plane_not_determined", "model_misfit", "weak"]
    mends: list[dict[str, Any]] = [
        {"contradicted": False}, {"tilt_deg": 30.0}, {"converged": True}, {"stripes": 10}, {"corner_px": 0.1}, {},
    ]  # fmt: skip
    for code, mend in zip(order, mends, strict=True):
        found = _verdict(**bad)
        assert found.code == code
        bad |= mend
    assert found.text == (
        "stripes of whole views lie 3.00 px apart beyond their noise and none stands out (a board that is not flat, or "
        "that moved between laser off and on?); 4 of 4 boards are out of focus (stop down, or keep them within the "
        "depth of field); only 4 views; the focal length is known to 1.2 % only (tilt the board more); the laser "
        "plane's turn to 0.46° only (record nearer and farther boards)"
    )


def test_words_give_the_figures() -> None:
    assert _verdict().text == "10 views agree; left-out views are predicted to 0.012 mm"
    assert "more of 12 views contradict" in _verdict(contradicted=True).text
    assert "open to 2.5°: 1 views show the stripe" in _verdict(stripes=1, plane_deg=2.5).text
    assert "corners are 1.23 px off" in _verdict(corner_px=1.234).text
    assert [too_few(n).text.split(" the board")[0] for n in (0, 1, 2)] == [
        "no view shows", "one view shows", "2 views show",
    ]  # fmt: skip
    assert (no_camera().code, boards_parallel().code) == ("not_converged", "boards_parallel")
