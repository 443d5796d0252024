"""When too many frames are lost, and what is said of what they have in common."""

from __future__ import annotations

import pytest

from calib.config import CalibConfig
from calib.copies import COPY
from calib.judge.contradiction import frames_contradict
from calib.result import Verdict
from geometry import Frame
from jig_cad import Jig, Sphere

OK, OUTLIERS, FEW = Verdict("ok", "fine"), Verdict("outliers", "too many"), Verdict("too_few_poses", "too few")
CONFIG = CalibConfig()
Lost = dict[int, str]


def _frames(lost: Lost, places: str = "AAAABBBBCCCC", verify: int = 0) -> tuple[Frame, ...]:
    roles = ["calibrate"] * (len(places) - verify) + ["verify"] * verify
    return tuple(
        Frame(number=k, location=n, role=role, reason=lost.get(k))  # type: ignore[arg-type]
        for k, (n, role) in enumerate(zip(places, roles, strict=True))
    )


def _said(frames: tuple[Frame, ...], verdict: Verdict = OK, cause: str = "") -> str:
    found = frames_contradict(frames, Jig.nominal(), verdict, CONFIG, lambda _lost: cause)
    if found is None:
        return ""
    assert found.code in ("frames_contradict", "poses_not_distinct")
    return found.text


def test_a_third_may_be_lost_and_no_more() -> None:
    assert _said(_frames(dict.fromkeys((0, 4, 8, 11), "outlier"))) == ""
    assert _said(_frames(dict.fromkeys((0, 4, 8, 10, 11), "outlier"))) == (
        "5 of 12 calibrate frames had to be left out (limit 33%), so that what is left is no answer: 5 outlier "
        "(contradicted by the others). In all, fine"
    )
    with_verify = _frames(dict.fromkeys((0, 8, 9, 10, 11), "no_spots"), verify=4)
    assert _said(with_verify).startswith("5 of 12 frames had to be left out")
    told = _said(with_verify, cause="rows are late")
    assert "so that what is left is no answer: rows are late. In all, fine" in told


@pytest.mark.parametrize(
    ("lost", "words"),
    [
        ({0: "outlier", 1: "outlier", 2: "outlier", 3: "outlier", 9: "outlier"}, "; no frame is left of location A."),
        ({0: "no_spots", 1: "no_spots", 5: "outlier", 9: "x", 10: "no_spots"},
         ": 3 no_spots (no string found in the image), 1 outlier (contradicted by the others), 1 x (left out). In all"),
        ({7: "outlier", 8: "outlier", 9: "outlier", 10: "outlier", 11: "outlier"}, "; all from frame 7 on. In all"),
        ({2: "outlier", 3: "outlier", 4: "outlier", 5: "outlier", 6: "outlier"}, "; all from frame 2 to frame 6. In"),
        (dict.fromkeys(range(12), "outlier"), ": 12 outlier (contradicted by the others). In all, fine"),
    ],
)  # fmt: skip
def test_what_lost_frames_have_in_common(lost: Lost, words: str) -> None:
    assert words in _said(_frames(lost))


def test_all_of_one_place() -> None:
    five = dict.fromkeys((4, 5, 6, 7, 9), "outlier")
    assert "; all lie in one location, B. In" in _said(_frames(five, "AAAABBBBBBAA"))
    assert "location" not in _said(_frames(five, "A" * 12))


def test_contradictions_without_lost_frames_are_said_where_they_have_a_cause() -> None:
    assert _said(_frames({}), OUTLIERS) == ""
    assert _said(_frames({}), OUTLIERS, "rows are late") == "rows are late. In all, too many"
    assert _said(_frames({}), OK, "rows are late") == ""
    ball = frames_contradict(_frames({}), Sphere(40.0), OUTLIERS, CONFIG, lambda _lost: "rows are late")
    assert ball is None


def test_frames_that_nobody_can_see_say_what_is_in_their_place() -> None:
    """Where every lost frame was unreadable, more poses would not help."""
    unseen = dict.fromkeys(range(11), "image_unreadable")
    assert _said(_frames(unseen), FEW).endswith("Each left-out frame's own sentence says what is in its place")
    assert _said(_frames(unseen | {3: "outlier"}), FEW).endswith("In all, too few")
    assert _said(_frames(unseen), OUTLIERS).endswith("In all, too many")


def test_copies_count_with_their_twin() -> None:
    copies = dict.fromkeys(range(1, 12), COPY)
    assert _said(_frames(copies), FEW) == (
        "11 calibrate frames repeat others to the last digit: move the robot between the frames of a location. In all, "
        "too few"
    )
    assert _said(_frames(copies), OK) == ""
    assert _said(_frames({}, "AB"), FEW) == ""
    assert _said(_frames({0: "outlier", 1: "outlier"}, "AAA"), FEW).startswith("2 of 3 calibrate frames")
    assert _said(_frames({0: "outlier", 1: "outlier"}, "AAB"), FEW) == ""
