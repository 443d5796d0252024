"""From measured frames to the sensor centre position: labels, axis points, poses, SCP, verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from calib.bundle import Evidence, check_evidence
from calib.config import CalibConfig
from calib.copies import in_order, without_copies
from calib.hands import with_joints
from calib.mount import Mount, chain_of, mount_words, seen_from
from calib.result import CalibrationResult
from calib.stages import (
    Setup,
    concluded,
    judged_answer,
    of_true_size,
    one_or_more,
    paper_answer,
    prepare,
    sound_evidence,
    sound_readings,
    with_model,
)
from geometry import Frame, InputError, Pose, Robot, Sensor, Target


def calibrate(
    frames: Sequence[Frame],
    target: Target | Mapping[str, Target],
    robot: Robot | None,
    sensor: Sensor,
    T_hand_sensor: Pose | None = None,
    places: Mapping[str, Pose] | None = None,
    config: CalibConfig | None = None,
    mount: Mount = "hand",
    evidence: Sequence[Evidence] = (),
) -> CalibrationResult:
    """Solve the sensor centre position from all frames with role calibrate; judge it on all locations.

    Parameters
    ----------
    frames : sequence of Frame
        With the points that extraction found (or labelled ones), and joint readings or hand poses.
    target : Target or mapping of str to Target
        What was measured: at every location, or by location.
    robot : Robot or None
        Nominal; None where every frame has T_base_hand.
    sensor : Sensor
        Whose frame {P} the points are in.
    T_hand_sensor : Pose, optional
        The SCP by design: some millimetres and degrees off. Where no drawing gives it surfaces do without, and strings
        with five of them in the frames.
    places : mapping of str to Pose, optional
        T_base_target of locations where it is known; it then decides between symmetric poses.
    config : CalibConfig, optional
        Model, method and every number that decides; None: the defaults.
    mount : "hand" or "fixed"
        Where the sensor is. With "fixed" it stands in the base and the hand carries the target: T_hand_sensor is then
        T_base_sensor, here and in the answer, and every T_base_target is T_hand_target.
    evidence : sequence of Evidence, optional
        What is known beside the points: a tracker's positions, sockets, distances.

    Returns
    -------
    CalibrationResult
        Also for data from which no trustworthy answer follows: its verdict says why.

    Raises
    ------
    InputError
        Where the input can not be used at all.

    References
    ----------
    Jeong & Kang, Autonomous Sensor Center Position Calibration with Linear Laser-Vision Sensor, 2003.
    """
    if not frames:
        raise InputError("the dataset has no frames")
    asked = config or CalibConfig()
    given = seen_from(mount, without_copies(with_joints(in_order(frames), robot)))
    setup = Setup(one_or_more(target, frames), robot, sensor, T_hand_sensor, places or {}, asked)
    check_evidence(evidence, robot, all(f.joints_rad is not None for f in given))
    setup, model_words = with_model(replace(setup, evidence=tuple(evidence)), given)
    setup, false_words = sound_readings(replace(setup, robot=chain_of(mount, setup.robot)))

    stated = prepare(setup, given)  # labels and axis points, by design and then by the chain that the bundle solves
    if asked.method == "paper":
        prepared, size_words = stated, ""
        result = paper_answer(prepared)
    else:
        prepared, size_words = of_true_size(stated)
        prepared, more_false = sound_evidence(prepared)
        false_words += more_false
        result = judged_answer(prepared)  # every number a suspect; locations left out in turn; figures
    words = (*model_words, *mount_words(mount), *false_words)
    result = replace(result, model_asked=asked.model, mount=mount, remarks=(*words, *result.remarks))
    return concluded(result, prepared, size_words)
