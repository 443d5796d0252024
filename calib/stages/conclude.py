"""What is said last: the cause where data contradict one another, and remarks on places, hand poses and copies."""

from __future__ import annotations

from dataclasses import replace

from calib.answer import location_pose
from calib.compliance import compliance_words
from calib.copies import COPY, copy_notes
from calib.given_places import given_place_notes
from calib.hands import hand_pose_notes
from calib.judge import cause_of, culprit, frames_contradict, strangers, with_own_poses, wrong_jig
from calib.printed import gimbal_note
from calib.result import CalibrationResult, Verdict
from calib.stages.preparation import hands_tell_nothing
from calib.stages.setup import CONTRADICTED, Prepared, Setup
from calib.stages.steps import out_of_step
from geometry import Frame, Pose, locations_of, target_at
from jig_cad import Jig


def concluded(result: CalibrationResult, prepared: Prepared, size: str) -> CalibrationResult:
    """The result with the last word on its verdict; ``size``: the sentence on a target of another size than stated."""
    setup, labelled = prepared.setup, prepared.labelled
    named = _named(result.verdict, prepared)
    verdict = (
        frames_contradict(
            result.frames, setup.target, named, setup.config, lambda lost: _cause(result, setup, lost=lost)
        )
        or named
    )
    if size and verdict.trustworthy:
        verdict = Verdict("priors_contradict", f"{size}. In all, {verdict.text}")
    if not verdict.trustworthy:  # what was left out in turn was left out of no answer, and there is none to enter
        said = tuple(r for r in result.remarks if "T_hand_sensor_nominal" not in r and "leaving one" not in r)
        result = replace(result, left_out=None, left_out_rms_mm={}, remarks=said)
    bends = result.joint_compliances
    words = compliance_words(bends)
    if bends and not any(j.observed for j in bends) and verdict.code == "ok":
        verdict = Verdict("weak", words)
    remarks = (*result.remarks, *_remarks(setup, labelled, result), *((words,) if words else ()))
    return replace(result, verdict=verdict, remarks=remarks)


def _cause(result: CalibrationResult, setup: Setup, *, lost: bool) -> str:
    """What of the files the frames' own poses contradict; "" where nothing shows."""
    if not isinstance(setup.target, Jig):
        return ""
    every = tuple(f for f in result.frames if f.reason != COPY)
    return cause_of(every, setup.target, setup.robot, setup.sensor, setup.design, setup.config, lost=lost)


def _named(verdict: Verdict, prepared: Prepared) -> Verdict:
    """The verdict on data that contradict one another, with what the motions say of the cause before all else."""
    setup, labelled = prepared.setup, prepared.labelled
    if verdict.code not in CONTRADICTED and not prepared.solved.contradicted:
        return verdict
    if isinstance(setup.target, Jig):
        found = wrong_jig(labelled, setup.target) or culprit(labelled, setup.target, setup.robot)
    else:
        found = "" if hands_tell_nothing(setup, labelled) else out_of_step(prepared)
    return replace(verdict, text=f"{found}. In all, {verdict.text}") if found else verdict


def _remarks(setup: Setup, labelled: tuple[Frame, ...], result: CalibrationResult) -> tuple[str, ...]:
    """What is to be said of given places and hand poses."""
    T, groups = result.T_hand_sensor or setup.design, locations_of(labelled)
    known = {} if T is None else {n: groups[n] for n in setup.places if n in groups}
    seen: dict[str, Pose | None] = {}
    if T is not None:
        seen = {n: location_pose(g, target_at(setup.target, n), (T, result.robot)) for n, g in known.items()}
    found = {n: T for n, T in seen.items() if T is not None}
    hands = hand_pose_notes(labelled, setup.config.hand_floor_mm, setup.config.hand_floor_deg)
    T, covariance = result.T_hand_sensor, result.covariance
    locked = () if T is None or covariance is None else gimbal_note(T, covariance)
    return (
        *given_place_notes(setup.places, found, setup.target),
        *hands,
        *copy_notes(labelled),
        *locked,
        *_left_out_notes(setup, labelled, result),
    )


def _left_out_notes(setup: Setup, labelled: tuple[Frame, ...], result: CalibrationResult) -> tuple[str, ...]:
    """What whole frames that the answer does without have against them."""
    gone = {f.number for f in result.frames if f.reason in ("outlier", "not_labelled") and f.role == "calibrate"}
    if not gone or not result.verdict.trustworthy:
        return ()
    words = ""
    if isinstance(setup.target, Jig):
        words = strangers(with_own_poses(labelled, setup.target, setup.sensor, setup.config), setup.target, gone)
    words = words or _unlike_the_rest(result)
    return (f"{words}. The answer does without {'it' if len(gone) == 1 else 'them'}",) if words else ()


def _unlike_the_rest(result: CalibrationResult) -> str:
    """A sentence on the frames that all others contradict; "" where there is none."""
    numbers = [f.number for f in result.frames if f.reason == "outlier" and f.role == "calibrate"]
    if not numbers:
        return ""
    one = len(numbers) == 1
    return (
        f"{'frame' if one else 'frames'} {', '.join(map(str, numbers))} {'contradicts' if one else 'contradict'} all "
        f"others: the joints (or the hand pose) or the location of {'its row are' if one else 'their rows are'} not "
        f"those of {'its image' if one else 'their images'}"
    )
