"""Which files one suspects where most frames of a cell could not be used, beside the verdict on the numbers."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib import CalibConfig, CalibrationResult, Verdict
from geometry import Camera, Frame, InputError, Pose, target_at
from geometry.sensor import project
from jig_cad import Jig
from workbench.files import Cell

_SUSPECTS = {
    "not_labelled": "no pose of the jig explains them: check that jig.toml and sensor.toml are this cell's, that "
    "scp_initial is within some 10 mm and 10° of the truth, and the order and units of the joint columns",
    "no_spots": "their images show no string: check the exposure, and bit_depth and black_level of sensor.toml",
    "too_few_spots": "their images show too few strings: check the exposure and that the whole jig is in view",
    "image_unreadable": "their complaints say why: check the column image of frames.csv and [image] of sensor.toml",
    "robot_out_of_range": "check min_deg and max_deg of robot.toml, and the joint columns",
}
MAX_KINDS = 3  # of complaints about images that are named in the verdict
LEAST_SEEN = 0.5  # share of given points that the sensor's camera must have in its image
UNITS = {25.4: "inches", 10.0: "centimetres", 1e3: "metres"}  # how many mm one is
LEAST_PIXELS = 5  # points with pixels, to judge by
SAME_PX = 2.0  # spots are known to tenths of a pixel, and a file's rounding is less


def remarks(result: CalibrationResult) -> tuple[str, ...]:
    """Sentences for the user: why most frames could not be used."""
    return tuple(_left_out(result))


def out_of_limits(cell: Cell) -> Iterator[str]:
    """A sentence for every joint that reads outside a stated limit, with the frames."""
    frames = [f for f in cell.frames if f.joints_rad is not None and f.T_base_hand is None]
    if not frames or cell.robot is None:
        return
    readings = np.rad2deg([f.joints_rad for f in frames if f.joints_rad is not None])
    low, high = (np.rad2deg(limits) for limits in cell.arm.dh_part().stated_limits)
    for beyond, limit, word, worst in (
        (readings < low, low, "below its lower", np.argmin),
        (readings > high, high, "above its upper", np.argmax),
    ):
        for joint in np.flatnonzero(beyond.any(axis=0)):
            here = np.flatnonzero(beyond[:, joint])
            k = int(worst(readings[:, joint]))
            more = f", and {len(here) - 1} further frames do" if len(here) > 1 else ""
            yield (
                f"joint {joint + 1} reads {readings[k, joint]:g}° in frame {frames[k].number}, {word} limit of "
                f"{limit[joint]:g}°{more}: frames out of a robot's limits are left out"
            )


def beyond_labelling(cell: Cell, frames: Sequence[Frame], config: CalibConfig) -> Iterator[str]:
    """A sentence where frames hold more spots than labelling considers."""
    most = config.labelling.max_candidates
    unnamed = [f for f in frames if not f.labels_given and len(f.points) > most and _has_strings(cell, f.location)]
    if unnamed:
        worst = max(unnamed, key=lambda f: len(f.points))
        more = f", and {len(unnamed) - 1} further frames hold more than {most}" if len(unnamed) > 1 else ""
        yield (
            f"frame {worst.number} holds {len(worst.points)} spots{more}: the {most} best of a frame are considered as "
            "strings, the others left out; max_candidates of [calib.labelling] may be raised"
        )


def beside_the_camera(cell: Cell) -> Iterator[str]:
    """A sentence where the given points are not what the camera of sensor.toml sees: most not at all, or elsewhere."""
    camera = cell.sensor.camera
    if camera is None or not cell.points:
        return
    given = [g.points for g in cell.points.values() if len(g.points)]
    axes = [g.axis for g in cell.points.values() if g.axis is not None and not len(g.points)]
    yz = np.concatenate([*(p.yz_mm for p in given), *(a.yz_mm for a in axes), np.zeros((0, 2))])
    if not len(yz):
        return
    seen = _seen(camera, yz)
    file = cell.folder / "points.csv"
    if np.mean(seen) < LEAST_SEEN:
        fits = [unit for times, unit in UNITS.items() if np.mean(_seen(_moved(camera, times), yz)) > 1 - LEAST_SEEN]
        if fits:
            raise InputError(
                f"{cell.folder}: the camera of sensor.toml sees {np.mean(seen):.0%} of the points of {file.name}, and "
                f"nearly all if translation_mm of [camera.pose] holds {fits[0]}: millimetres are right"
            )
        yield (
            f"the camera of sensor.toml sees {np.mean(seen):.0%} of the points of {file.name}: check [camera] and "
            "[camera.pose], or whether the points are another sensor's"
        )
        return
    uv = np.concatenate([*(p.uv_px for p in given), np.zeros((0, 2))])
    there = np.isfinite(uv).all(axis=1)
    if np.sum(there) < LEAST_PIXELS:
        return
    by = project(camera, np.insert(np.concatenate([p.yz_mm for p in given])[there], 0, 0.0, axis=1))
    off = float(np.median(np.nan_to_num(np.linalg.norm(by - uv[there], axis=1), nan=np.inf)))
    if off > SAME_PX:
        yield (
            f"u_px, v_px of {file.name} lie {off:.2g} px (median) from where sensor.toml sees y_surface_mm, "
            "z_surface_mm: the points were measured by another sensor.toml, and an SCP belongs to its own"
        )


def _seen(camera: Camera, yz_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points (N, 2) of the sheet lie in the camera's image."""
    uv = project(camera, np.insert(yz_mm, 0, 0.0, axis=1))
    with np.errstate(invalid="ignore"):
        return np.asarray(np.all((uv > -1.0) & (uv < [camera.width_px, camera.height_px]), axis=1))


def _moved(camera: Camera, times: float) -> Camera:
    """The camera with its place in another unit."""
    pose = camera.T_sensor_camera
    return replace(camera, T_sensor_camera=Pose(pose.R, pose.t * times))


def _has_strings(cell: Cell, location: str) -> bool:
    known = not isinstance(cell.target, Mapping) or location in cell.target
    return known and isinstance(target_at(cell.target, location), Jig)


_NUMBER = re.compile(r"[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def merged(sentences: Iterable[str]) -> tuple[str, ...]:
    """Sentences of the form ``file: what``, those of like words told once with their number, whatever their figures."""
    first: dict[str, str] = {}
    words: dict[str, list[str]] = {}
    for sentence in sentences:
        named, _, what = sentence.partition(": ")
        what = what or named
        kind = _NUMBER.sub("0", what) if what is not named else sentence
        first.setdefault(kind, sentence)
        words.setdefault(kind, []).append(what)
    return tuple(
        f"{sentence}; the {'same' if len(set(words[kind])) == 1 else 'like'} of {len(words[kind]) - 1} further files"
        if len(words[kind]) > 1
        else sentence
        for kind, sentence in first.items()
    )


def _left_out(result: CalibrationResult) -> Iterator[str]:
    """What most of the calibrate frames lack, where no answer was found."""
    if result.T_hand_sensor is not None:
        return
    asked = [f for f in result.frames if f.role == "calibrate"]
    if not asked:
        yield "no frame has the role calibrate, and frames with the role verify are never solved with"
        return
    reason, n = Counter(f.reason for f in asked).most_common(1)[0]
    if reason in _SUSPECTS and 2 * n > len(asked):
        yield f"{n} of {len(asked)} calibrate frames were left out as {reason}; {_SUSPECTS[reason]}"


def with_complaints(verdict: Verdict, complaints: Mapping[int, str], folder: Path) -> Verdict:
    """The verdict frames_contradict with what is wrong with the images, the commonest sentence for all of its kind."""
    if verdict.code != "frames_contradict" or not complaints:
        return verdict
    kinds = Counter(_kind(text, folder) for text in complaints.values())
    words = ", ".join(kind for kind, _ in kinds.most_common(MAX_KINDS))
    return replace(verdict, text=verdict.text.replace("(images unreadable)", f"(images unreadable: {words})"))


def _kind(complaint: str, folder: Path) -> str:
    """A complaint without the file that it names: the same for all files of a kind."""
    named, _, rest = complaint.partition(": ")
    return rest.removeprefix("is ") if rest and named.startswith(str(folder)) else complaint
