"""Jig poses of the frames of a points.csv."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from calib import CalibConfig
from calib.label import label_frame
from calib.pose import JigPoseResult, jig_pose
from geometry import AxisPoints, InputError, NoAnswerError, Sensor
from jig_cad import Jig
from workbench.cell.presets import find_jig, find_sensor
from workbench.files import GivenPoints, read_points

WORDS = {
    "unique": "one pose explains the points; of those that turn the jig onto itself, the one with x_jig · x_sensor > 0",
    "mirror": "a mirror pose explains the points as well",
    "weak": "a direction of the pose is hardly determined by these points",
}


@dataclass(frozen=True, eq=False)
class FramePose:
    """The poses of one frame, or the reason why there is none."""

    frame: int
    result: JigPoseResult | None
    reason: str | None = None

    @property
    def words(self) -> str:
        """What the candidates mean."""
        return WORDS.get(self.result.ambiguity, "") if self.result else ""


def frame_poses(points: Path, jig: str | None, sensor: str | None, frame: int | None) -> list[FramePose]:
    """The poses of every frame of the file, or of one."""
    if not points.exists():
        raise InputError(f"{points}: no such file")
    the_jig = find_jig(jig or _beside(points, "jig.toml", "target.toml"))
    frames = read_points(points, the_jig.strings)
    if not frames:
        raise InputError(f"{points}: holds no points")
    if frame is not None and frame not in frames:
        raise InputError(f"{points}: holds no frame {frame}; its frames are {min(frames)} … {max(frames)}")
    chosen = frames if frame is None else {frame: frames[frame]}
    needs_sensor = any(f.axis is None for f in chosen.values())
    model = find_sensor(sensor or _beside(points, "sensor.toml")) if needs_sensor else None
    return [_pose(number, given, the_jig, model) for number, given in sorted(chosen.items())]


def _beside(points: Path, *names: str) -> str:
    """The first file of these names beside the points."""
    for name in names:
        if (points.parent / name).exists():
            return str(points.parent / name)
    option = names[0].removesuffix(".toml")
    raise InputError(f"{points.parent / names[0]}: no such file; give --{option} FILE or the name of a preset")


def _pose(frame: int, given: GivenPoints, jig: Jig, sensor: Sensor | None) -> FramePose:
    axis = given.axis
    if axis is None and sensor is not None:
        labelled = label_frame(given.points, jig, sensor, None, CalibConfig())
        if labelled.reason is not None:
            return FramePose(frame, None, labelled.reason)
        axis = labelled.axis
    try:
        return FramePose(frame, jig_pose(axis or AxisPoints.empty(), jig))
    except NoAnswerError as error:
        return FramePose(frame, None, str(error))
