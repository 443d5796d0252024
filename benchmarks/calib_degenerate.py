"""Data from which no trustworthy answer follows: is it said, every time?

Run: python benchmarks/calib_degenerate.py [CELLS] [SEED]. Every cell is spoilt in every way below; a verdict "ok" or
"model_misfit" (exit code 0) counts as silence, "weak" as said, and so does an answer without frames that a remark
names. "named": how often the words name the very cause, where
one is to be named. The last lines are sound data, where silence is right.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calib import CalibConfig
from calib.synthetic.cell import (
    CellFrames,
    Noise,
    SyntheticCell,
    axis_points,
    calibrated,
    made_cell,
    observe,
    random_cell,
)
from calib.synthetic.degenerate import constant_lever, mirror_frames
from calib.synthetic.problem import CALIBRATE_ONLY
from geometry import AxisPoints, DhRobot, Frame, Pose, exp_so3
from jig_cad import Jig

Frames = tuple[Frame, ...]
Spoil = Callable[[Frames, SyntheticCell, np.random.Generator], tuple[Frames, Jig, DhRobot]]
NOISE = Noise()
# what the words must hold where the cause can be named
NAMED = {
    "labels swapped (half turn) in half the frames": "turned by half",
    "labels swapped (A, B) in all frames": "labels A and B are exchanged",
    "labels swapped (B', C') in all frames": "labels B' and C' are exchanged",
    "joints in radians under a degree header": "hold radians",
    "joints in another order": "joints 5 and 6 are exchanged",
    "joints of the next frame": "of the row before",
    "two locations under one name": "two locations bear one name",
    "frames of another location": "their location is misnamed",
    "one frame of another location": "frame 3 does not move as the other frames of location C does but as those of",
    "one frame with the joints of another": "frame 3 does not move as the other frames of location A",
    "DH row of another arm (d4)": "d of joint 4",
    "DH row of another arm (a2)": "a of joint 2",
    "DH row of another arm (α2)": "α of joint 2",
    "sign of joint 4 flipped": "joint 4 counts the other way round",
    "jig file of another size (side)": "its side_mm is about",
    "jig file of another size (height)": "its height_mm is about",
}
MIRROR = "mirror images that nothing resolves"
LEFT_OUT = "ok, frames left out by name"
LEVER = "lever that stands still (paper)"


def spoils() -> dict[str, Spoil]:
    """Ways to spoil a data set, by name."""

    def frames_only(change: Callable[[Frames, SyntheticCell, np.random.Generator], Frames]) -> Spoil:
        return lambda f, c, rng: (change(f, c, rng), c.jig, c.robot)

    def each(change: Callable[[Frame], Frame]) -> Spoil:
        return frames_only(lambda f, c, rng: tuple(map(change, f)))

    def robot_only(change: Callable[[DhRobot], DhRobot]) -> Spoil:
        return lambda f, c, rng: (f, c.jig, change(c.robot))

    return {
        "two frames": frames_only(lambda f, c, rng: f[:2]),
        "one frame a location": frames_only(lambda f, c, rng: (f[0], f[7], f[14])),
        "all frames alike": frames_only(lambda f, c, rng: _alike(f, c, rng, 0.0, 3)),
        "rotation of 1°": frames_only(lambda f, c, rng: _alike(f, c, rng, 1.0, 3)),
        "rotation about one axis": frames_only(lambda f, c, rng: _alike(f, c, rng, 15.0, 1)),
        "labels swapped (half turn) in half the frames": frames_only(
            lambda f, c, rng: _swap(f, c.jig.symmetries[0].relabelled, 2)
        ),
        "labels swapped (A, B) in all frames": frames_only(lambda f, c, rng: _swap(f, _ab, 1)),
        "labels swapped (B', C') in all frames": frames_only(lambda f, c, rng: _swap(f, _diagonals, 1)),
        "half the points outliers": frames_only(lambda f, c, rng: _outliers(f, rng)),
        "joints in radians under a degree header": each(lambda x: replace(x, joints_rad=np.deg2rad(x.joints_rad))),
        "joints in another order": each(lambda x: replace(x, joints_rad=x.joints_rad[[0, 1, 2, 3, 5, 4]])),
        "joints of the next frame": frames_only(
            lambda f, c, rng: tuple(replace(x, joints_rad=y.joints_rad) for x, y in zip(f, (*f[1:], f[0]), strict=True))
        ),
        "two locations under one name": each(lambda x: replace(x, location="A" if x.location == "B" else x.location)),
        "frames of another location": frames_only(lambda f, c, rng: _misplaced(f)),
        "one frame of another location": each(lambda x: replace(x, location="C") if x.number == 3 else x),
        "one frame with the joints of another": frames_only(
            lambda f, c, rng: tuple(replace(x, joints_rad=f[15].joints_rad) if x.number == 3 else x for x in f)
        ),
        "DH row of another arm (d4)": robot_only(lambda r: r.with_changes(d=_at(3, -142.0))),
        "DH row of another arm (a2)": robot_only(lambda r: r.with_changes(a=_at(1, 60.0))),
        "DH row of another arm (α2)": robot_only(lambda r: r.with_changes(alpha=_at(1, np.pi / 2))),
        "sign of joint 4 flipped": robot_only(lambda r: replace(r, sign=np.array([1, 1, 1, -1, 1, 1.0]))),
        "jig file of another size (side)": lambda f, c, rng: (f, Jig.nominal(side_mm=80.0), c.robot),
        "jig file of another size (height)": lambda f, c, rng: (f, Jig.nominal(height_mm=120.0), c.robot),
    }


def _at(joint: int, value: float) -> np.ndarray:
    return value * np.eye(6)[joint]


def _ab(label: str) -> str:
    return {"A": "B", "B": "A"}.get(label, label)


def _diagonals(label: str) -> str:
    return {"B'": "C'", "C'": "B'"}.get(label, label)


def _alike(frames: Frames, cell: SyntheticCell, rng: np.random.Generator, degrees: float, axes: int) -> Frames:
    """Seven frames of one location whose hand turns by up to ``degrees`` about x (or any axis) and moves by 20 mm."""
    first = frames[0]
    hand = cell.robot.pose(first.joints_rad)
    jig = cell.T_base_jig[first.location]
    out = []
    for i in range(7):
        turn = np.deg2rad(degrees) * rng.uniform(-1, 1, 3) * (np.arange(3) < axes)
        move = rng.uniform(-10, 10, 3) * (degrees > 0)
        pose = hand @ Pose(exp_so3(turn), move)
        yz = axis_points((pose @ cell.T_hand_sensor).inverse() @ jig, cell.jig)
        yz = yz + rng.normal(size=yz.shape) * NOISE.point_mm
        axis = replace(first.axis, yz_mm=yz)
        out.append(replace(first, number=i, axis=axis, joints_rad=None, T_base_hand=pose))
    return tuple(out)


def _swap(frames: Frames, to: Callable[[str], str], every: int) -> Frames:
    return tuple(
        replace(f, axis=replace(f.axis, label=tuple(to(x) for x in f.axis.label))) if f.number % every == 0 else f
        for f in frames
    )


def _outliers(frames: Frames, rng: np.random.Generator) -> Frames:
    def spoilt(axis: AxisPoints) -> AxisPoints:
        bad = rng.random(len(axis)) < 0.5
        return replace(axis, yz_mm=axis.yz_mm + bad[:, None] * rng.uniform(-20, 20, axis.yz_mm.shape))

    return tuple(replace(f, axis=spoilt(f.axis)) for f in frames)


def _misplaced(frames: Frames) -> Frames:
    """Every second frame of location B under the name C and the other way round."""
    other = {"B": "C", "C": "B"}
    return tuple(replace(f, location=other.get(f.location, f.location)) if f.number % 2 else f for f in frames)


def main() -> None:
    """Print, for every kind, how often it was said and by which codes."""
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    rng = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    codes: dict[str, Counter[str]] = {
        name: Counter() for name in [*spoils(), MIRROR, LEVER, "sound (scp)", "sound (full)"]
    }
    named = Counter[str]()
    for _ in range(cells):
        cell = random_cell(rng, CALIBRATE_ONLY)
        made = made_cell(cell, rng, NOISE)
        observed = observe(cell, made, rng, NOISE)
        for name, spoil in spoils().items():
            frames, jig, robot = spoil(observed.frames, cell, rng)
            spoilt = CellFrames(frames, observed.sensor, observed.design)
            result = calibrated(spoilt, jig, robot)
            cause = NAMED.get(name, "no cause to name")
            remarked = any(cause in r for r in result.remarks)
            codes[name][LEFT_OUT if remarked and result.verdict.code == "ok" else result.verdict.code] += 1
            named[name] += remarked or cause in result.verdict.text
        mirrored, lever = mirror_frames(cell, rng, NOISE), constant_lever(cell, rng, NOISE)
        codes[MIRROR][calibrated(mirrored, cell.jig, None).verdict.code] += 1
        codes[LEVER][calibrated(lever, cell.jig, None, CalibConfig(method="paper")).verdict.code] += 1
        for model in ("scp", "full"):
            codes[f"sound ({model})"][
                calibrated(observed, cell.jig, cell.robot, CalibConfig(model=model)).verdict.code
            ] += 1
    said = total = 0
    for name, counts in codes.items():
        silent = counts["ok"] + counts["model_misfit"]
        if not name.startswith("sound"):
            said, total = said + sum(counts.values()) - silent, total + sum(counts.values())
        cause = f", named {named[name]} of {sum(counts.values())}" if name in NAMED else ""
        print(f"{name:48s} {dict(counts)}{cause}")
    print(f"said: {said} of {total}")


if __name__ == "__main__":
    main()
