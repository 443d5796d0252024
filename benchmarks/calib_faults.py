"""Is a wrong number in a file ever passed in silence? Some fifty kinds of fault on cells of five arms, four models.

Balls, planes and wedges: benchmarks/calib_faults_surfaces.py.
Run: python benchmarks/calib_faults.py [--cells N] [--seed FIRST] [--models scp,full,…] [--kinds REGEX] [--store FILE].
One line of JSON a run goes to FILE, and what stands there already is not done again; the table is of all that stands
there. Points are made by OpenCV's projection of the strings' true crossings, not by calib's own code: pixels with
noise, turned into millimetres by the sensor's file with OpenCV's inverse. Labels are given: labelling is not tried.

The error of an answer is what it predicts: the target's points at a location not used, carried to the base by this SCP
with this table and this sensor file, against truth, less what a turn about joint 1 and a shift along it do (no datum
shows these); its rms over the rms of the σ stated.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from zlib import crc32

import cv2
import numpy as np

from calib import CalibConfig, CalibrationResult, calibrate
from calib.bundle import make_bundle, solve_problem
from calib.hands import placed
from calib.label import label_frames
from calib.printed import nees
from calib.synthetic.cell import Layout, default_sensor, random_cell
from geometry import AxisPoints, Camera, DhRobot, Frame, Pose, Sensor, draw_errors, exp_so3, stack_poses
from jig_cad import Jig, sample_tolerance
from workbench.cell.presets import find_robot

ARMS = ("kuka_kr210_l150", "abb_irb6640_180_255", "fanuc_m20ia_10l", "hyundai_ha006b", "ur10e")
PIXEL_SIGMA = 0.2  # some 0.03 mm along z with this sensor
JOINT_RAD = float(np.deg2rad(0.003))
MODELS = ("auto", "scp", "full", "scp+offsets")
FAILS_AT, EFFECT = 4.0, 1.0  # σ


@dataclass(frozen=True, eq=False)
class World:
    """What is true."""

    robot: DhRobot
    jig: Jig
    sensor: Sensor
    T_hand_sensor: Pose
    places: dict[str, Pose]


@dataclass(frozen=True, eq=False)
class Files:
    """What the files say; joints (F, 6) as read."""

    robot: DhRobot
    jig: Jig
    sensor: Sensor
    joints: np.ndarray
    locations: tuple[str, ...]
    roles: tuple[str, ...]
    copies: int = 1


Fault = Callable[[World, Files, np.random.Generator], tuple[World, Files]]


def row(group: str, joint: int) -> Fault:
    """A row of the robot's table 1 to 3 mm or 0.2 to 0.5 degrees off."""
    low, high = (1.0, 3.0) if group in "da" else np.deg2rad([0.2, 0.5])

    def fault(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
        change = np.zeros(6)
        change[joint] = rng.choice([-1, 1]) * rng.uniform(low, high)
        return world, replace(files, robot=files.robot.with_changes(**{group: change}))

    return fault


def encoder(joint: int) -> Fault:
    """A joint that lost its zero."""

    def fault(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
        joints = files.joints.copy()
        joints[:, joint] += np.deg2rad(rng.choice([-1, 1]) * rng.uniform(0.1, 1.0))
        return world, replace(files, joints=joints)

    return fault


def gear(joint: int) -> Fault:
    """A joint whose readings are scaled."""

    def fault(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
        joints = files.joints.copy()
        joints[:, joint] *= 1 + rng.choice([-1, 1]) * rng.uniform(1e-3, 5e-3)
        return world, replace(files, joints=joints)

    return fault


def _sensor(change: Callable[[Camera, float], Camera], low: float, high: float) -> Fault:
    def fault(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
        size = rng.choice([-1, 1]) * rng.uniform(low, high)
        camera = change(files.sensor.require_camera(), float(size))
        return world, replace(files, sensor=replace(files.sensor, camera=camera))

    return fault


def _turned(axis: int) -> Callable[[Camera, float], Camera]:
    def change(c: Camera, deg: float) -> Camera:
        turn = exp_so3(np.deg2rad(deg) * np.eye(3)[axis])
        pivot = np.array([0.0, 0.0, 290.0 if deg > 0 else 0.0])  # in the middle of the field, or at the emitter
        return replace(c, T_sensor_camera=Pose(turn, pivot - turn @ pivot) @ c.T_sensor_camera)

    return change


def _lens_left_out(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
    lens = (float(rng.uniform(-0.25, -0.08)), float(rng.uniform(0.05, 0.15)), 0.0, 0.0)
    return replace(world, sensor=world.sensor.with_camera(distortion=lens)), files


def _jig(key: str, size: float) -> Fault:
    def fault(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
        j = files.jig
        sizes = {"side_mm": j.side_mm, "height_mm": j.height_mm}
        sizes[key] += float(rng.choice([-1, 1])) * size
        six = {"strings": j.strings} if len(j.strings) == 6 else {}
        return world, replace(files, jig=Jig.nominal(**sizes, **six))

    return fault


def _anchor(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
    moved = world.jig.anchors_mm.copy()
    angle = rng.uniform(0, 2 * np.pi)
    moved[rng.integers(6), 1:] += 0.5 * np.array([np.cos(angle), np.sin(angle)])
    return replace(world, jig=replace(world.jig, anchors_mm=moved)), files


def _string(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
    return world, replace(files, jig=replace(files.jig, string_diameter_mm=files.jig.string_diameter_mm + 0.2))


def late(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
    """Readings one row late from the middle on."""
    first = len(files.joints) // 2
    joints = files.joints.copy()
    joints[first:] = files.joints[first - 1 : -1]
    return world, replace(files, joints=joints)


def _copies(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
    return world, replace(files, copies=3)


def calibrating(files: Files) -> int:
    """How many frames calibrate; they come first."""
    return sum(n in "ABC" for n in files.locations)


def one_joint(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
    """One reading of one frame a degree off."""
    joints = files.joints.copy()
    joints[rng.integers(calibrating(files)), rng.integers(6)] += np.deg2rad(1.0)
    return world, replace(files, joints=joints)


def one_location(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
    """One frame under another place's name."""
    names = list(files.locations)
    i = int(rng.integers(calibrating(files)))
    names[i] = {"A": "B", "B": "C", "C": "A"}[names[i]]
    return world, replace(files, locations=tuple(names))


def _all_one(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
    names = tuple("A" if n in "ABC" else n for n in files.locations)
    return world, replace(files, locations=names)


def too_sure(world: World, files: Files, rng: np.random.Generator) -> tuple[World, Files]:
    """[uncertainty] of the robot ten times too small."""
    u = files.robot.uncertainty
    ten = {
        k: getattr(u, k) / 10
        for k in ("joint_sigma_rad", "theta_sigma_rad", "d_sigma_mm", "a_sigma_mm", "alpha_sigma_rad")
    }
    return world, replace(files, robot=replace(files.robot, uncertainty=replace(u, **ten)))


SOUND = "sound"
GROUPS = {"theta": "theta", "d": "d", "a": "a", "alpha": "alpha"}
KINDS: dict[str, tuple[Fault, str]] = {SOUND: (lambda w, f, rng: (w, f), "")}
KINDS |= {f"{g}{i + 1}": (row(g, i), f"{g}{i + 1}") for g in GROUPS for i in range(6)}
KINDS |= {f"encoder{i + 1}": (encoder(i), f"theta{i + 1}") for i in range(6)}
KINDS |= {f"gear{i + 1}": (gear(i), f"reading_scale{i + 1}") for i in range(6)}
KINDS |= {
    "focal": (_sensor(lambda c, s: replace(c, fx_px=c.fx_px * (1 + s), fy_px=c.fy_px * (1 + s)), 3e-3, 1e-2), "focal"),
    "cx": (_sensor(lambda c, s: replace(c, cx_px=c.cx_px + s), 5.0, 5.0), "cx_px"),
    "cy": (_sensor(lambda c, s: replace(c, cy_px=c.cy_px + s), 5.0, 5.0), "cy_px"),
    "tilt_y": (_sensor(_turned(1), 0.05, 0.2), "plane_tilt_y"),
    "tilt_z": (_sensor(_turned(2), 0.05, 0.2), "plane_tilt_z"),
    "lens": (_lens_left_out, "k1"),
    "jig_side": (_jig("side_mm", 0.5), "side_mm"),
    "jig_height": (_jig("height_mm", 1.0), "height_mm"),
    "string": (_string, ""),
    "anchor": (_anchor, "anchor"),
    "late": (late, "frames"),
    "copies": (_copies, ""),
    "one_joint": (one_joint, ""),
    "one_location": (one_location, ""),
    "all_one": (_all_one, "frames"),
    "too_sure": (too_sure, "uncertainty"),
}


def world_of(seed: int) -> tuple[World, Files, np.ndarray]:
    """A cell, its files and the true joints (F, 6)."""
    rng = np.random.default_rng(seed)
    arm = find_robot(ARMS[seed % len(ARMS)])
    scale = min(1.0, _reach(arm) / 2550.0)
    plain = Layout()
    layout = replace(
        plain,
        radius_mm=tuple(scale * r for r in plain.radius_mm),
        height_mm=tuple(scale * h for h in plain.height_mm),
    )
    strings = {"strings": ("A", "B", "C", "B'", "C'", "D'")} if seed % 2 == 0 else {}
    jig = Jig.nominal(**strings)
    cell = random_cell(rng, layout, jig, arm)
    world = World(
        arm.corrected(draw_errors(arm, rng)), sample_tolerance(jig, rng), default_sensor(), cell.T_hand_sensor,
        cell.T_base_jig,
    )  # fmt: skip
    files = Files(arm, jig, default_sensor(), cell.joints_rad, cell.location, cell.role)
    return world, files, cell.joints_rad + rng.normal(size=cell.joints_rad.shape) * JOINT_RAD


def _reach(arm: DhRobot) -> float:
    return float(np.sum(np.abs(arm.a[1:])) + np.sum(np.abs(arm.d[1:])) + abs(arm.a[0]))


def true_points(world: World, true_joints: np.ndarray, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Crossings of the strings' axes with the sheet, and of what is seen of them (F, S, 3), in the true {P} [mm]."""
    jig = world.jig
    Ts = (world.robot.pose(true_joints) @ world.T_hand_sensor).inverse() @ stack_poses([world.places[n] for n in names])
    a = jig.anchors_mm[jig.start_index] @ np.swapaxes(Ts.R, -1, -2) + Ts.t[:, None]
    b = jig.anchors_mm[jig.end_index] @ np.swapaxes(Ts.R, -1, -2) + Ts.t[:, None]
    axis = a - a[..., :1] / (b - a)[..., :1] * (b - a)
    along = (b - a) / np.linalg.norm(b - a, axis=-1, keepdims=True)
    towards = np.zeros(3)
    for eye in world.sensor.viewpoints_mm:
        ray = eye - axis
        towards = towards + ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    towards = towards - np.sum(towards * along, -1, keepdims=True) * along
    towards = 0.86 * towards / np.linalg.norm(towards, axis=-1, keepdims=True)  # a matte thread's middle, in radii
    return axis, towards - towards[..., :1] / along[..., :1] * along


def pixels(sensor: Sensor, xyz: np.ndarray) -> np.ndarray:
    """Where OpenCV sees points (..., 3)."""
    c = sensor.require_camera()
    back = c.T_sensor_camera.inverse()
    uv = cv2.projectPoints(xyz.reshape(-1, 3), cv2.Rodrigues(back.R)[0], back.t, c.matrix, _lens(c))[0]
    return uv.reshape(*xyz.shape[:-1], 2)


def measured(sensor: Sensor, uv: np.ndarray) -> np.ndarray:
    """The points (..., 2) of the file's sheet that OpenCV's rays through pixels meet."""
    c = sensor.require_camera()
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-12)
    xy = cv2.undistortPointsIter(uv.reshape(-1, 1, 2), c.matrix, _lens(c), None, None, criteria)[:, 0]
    rays = np.column_stack([xy, np.ones(len(xy))]) @ c.T_sensor_camera.R.T
    p = c.centre_mm - c.centre_mm[0] / rays[:, :1] * rays
    return p[:, 1:].reshape(uv.shape)


def _lens(c: Camera) -> np.ndarray:
    return np.array(c.distortion or (0.0,) * 4)


@dataclass(frozen=True, eq=False)
class Observed:
    """The frames, and what is compared with truth: yz as the file has it without noise, and true points in the base."""

    frames: tuple[Frame, ...]
    joints: np.ndarray
    yz_mm: np.ndarray
    true_mm: np.ndarray


def observe(world: World, files: Files, true_joints: np.ndarray, truly: tuple[str, ...], seed: int) -> Observed:
    """Frames as the files would give them."""
    rng = np.random.default_rng(1000 + seed)
    axis, surface = true_points(world, true_joints, truly)
    off = (world.jig.string_diameter_mm - files.jig.string_diameter_mm) / 2 * surface
    uv = pixels(world.sensor, axis + off)
    noisy = uv + rng.normal(size=uv.shape) * PIXEL_SIGMA
    yz, exact = measured(files.sensor, noisy), measured(files.sensor, uv)
    step = 1e-3
    J = np.stack([(measured(files.sensor, uv + step * e) - exact) / step for e in np.eye(2)], -1)
    cov = PIXEL_SIGMA**2 * J @ np.swapaxes(J, -1, -2)
    labels = files.jig.strings
    none, flags = np.full(len(labels), -1), ("",) * len(labels)
    frames = []
    for copy in range(files.copies):
        for i in range(len(yz)):
            axes = AxisPoints(labels, none, yz[i], cov[i], flags)
            number = i + 1000 * copy
            frames.append(
                Frame(
                    number, files.locations[i], files.roles[i], joints_rad=files.joints[i], axis=axes,
                    labels_given=True,
                )
            )  # fmt: skip
    unused = [i for i, role in enumerate(files.roles) if role == "verify"]
    chain = world.robot.pose(true_joints) @ world.T_hand_sensor
    base = np.stack([chain[i] @ axis[i] for i in unused])
    return Observed(tuple(frames), files.joints[unused], exact[unused], base)


def predicted(T: Pose, robot: DhRobot, joints: np.ndarray, yz: np.ndarray) -> np.ndarray:
    """Points (F, S, 3) in the base."""
    chain = robot.pose(joints) @ T
    xyz = np.concatenate([np.zeros((*yz.shape[:2], 1)), yz], -1)
    return np.stack([chain[i] @ xyz[i] for i in range(len(chain))])


def open_directions(robot: DhRobot, joints: np.ndarray, points: np.ndarray) -> np.ndarray:
    """What a turn about joint 1 and a shift along it do to points (3N, 2), orthonormal."""
    change = []
    for group in ("theta", "d"):
        step = np.zeros(6)
        step[0] = 1e-6
        moved = robot.with_changes(**{group: step}).pose(joints)
        here = robot.pose(joints)
        both = [moved[i] @ (here[i].inverse() @ points[i]) - points[i] for i in range(len(joints))]
        change.append(np.ravel(both) / 1e-6)
    return np.linalg.qr(np.stack(change, -1))[0]


def error_and_sigma(result: CalibrationResult, files: Files, seen: Observed) -> tuple[np.ndarray, float]:
    """The error of prediction (3N,) and the rms of its stated σ."""
    e = result.trusted
    assert e is not None
    robot = result.robot if result.robot is not None else files.robot
    points = predicted(e.T_hand_sensor, robot, seen.joints, seen.yz_mm)
    out = open_directions(files.robot, seen.joints, points)
    error = (points - seen.true_mm).ravel()
    J = e.prediction_jacobian(seen.joints, seen.yz_mm)  # (F, S, 3, n)
    J = J.reshape(-1, J.shape[-1])
    J = J - out @ (out.T @ J)
    error = error - out @ (out.T @ error)
    return error, float(np.sqrt(np.trace(J @ e.joint_covariance @ J.T) / len(error)))


def plain_error(files: Files, seen: Observed) -> np.ndarray:
    """The error of prediction of a plain solution with the robot's errors under their priors, judged by nobody."""
    config, design = CalibConfig(model="full"), default_design()
    frames = label_frames(placed(seen.frames, files.robot), files.jig, files.sensor, design, {}, config)
    used = tuple(f for f in frames if f.role == "calibrate" and f.usable)
    solution = solve_problem(
        make_bundle(used, files.jig, files.robot, config), [f.candidates for f in used], design, config
    )
    points = predicted(solution.T_hand_sensor, solution.robot, seen.joints, seen.yz_mm)
    out = open_directions(files.robot, seen.joints, points)
    error = (points - seen.true_mm).ravel()
    return error - out @ (out.T @ error)


@lru_cache(maxsize=1)
def sound_error(seed: int) -> np.ndarray:
    """plain_error of the cell without a fault."""
    world, files, true_joints = world_of(seed)
    return plain_error(files, observe(world, files, true_joints, files.locations, seed))


def default_design() -> Pose:
    """The SCP by design."""
    from calib.synthetic.cell import DESIGN

    return DESIGN


def run(seed: int, kind: str, models: tuple[str, ...]) -> list[dict[str, object]]:
    """One cell with one fault by all models."""
    world, files, true_joints = world_of(seed)
    truly = files.locations
    rng = np.random.default_rng([seed, crc32(kind.encode())])
    world, bad = KINDS[kind][0](world, files, rng)
    seen = observe(world, bad, true_joints, truly, seed)
    effect = None
    if kind != SOUND:
        try:
            effect = float(np.sqrt(np.mean((plain_error(bad, seen) - sound_error(seed)) ** 2)))
        except Exception:  # noqa: BLE001 # no plain answer: the effect is beyond all measure
            effect = None
    rows = []
    solved: dict[str, dict[str, object]] = {}  # by what a model comes to: "auto" is "full" where joints are read
    for model in models:
        if model in solved:
            rows.append(solved[model] | {"model": model})
            continue
        row: dict[str, object] = {"seed": seed, "kind": kind, "model": model, "effect_mm": effect}
        try:
            result = calibrate(
                seen.frames, bad.jig, bad.robot, bad.sensor, default_design(), None, CalibConfig(model=model)
            )
            solved[result.model] = row
            row |= {
                "code": result.verdict.code,
                "text": result.verdict.text,
                "exit": 0 if result.verdict.trustworthy else 3,
            }
            row |= {"culprit": [[c.parameter, *c.same_as] for c in result.culprit], "chi2": result.chi2_per_dof}
            row |= {"pull": max((abs(p.pull_sigma) for p in result.pulls), default=0.0)}
            if result.trusted is not None:
                error, sigma = error_and_sigma(result, bad, seen)
                row |= {"sigma_mm": sigma, "error_mm": float(np.sqrt(np.mean(error**2)))}
                row |= {"nees": nees(world.T_hand_sensor, result.T_hand_sensor, result.covariance)}
        except Exception as error:  # noqa: BLE001 # a crash is a figure of this benchmark
            row |= {"code": "CRASH", "exit": 70, "text": f"{error!r} {traceback.format_exc()[-800:]}"}
        rows.append(row)
    return rows


def _rate(hits: list[bool]) -> str:
    return f"{sum(hits)} of {len(hits)}" + (f" ({np.mean(hits):.1%})" if hits else "")


def table(rows: list[dict[str, object]], culprits: dict[str, str]) -> Iterator[str]:
    """The required rates, and a line a kind; ``culprits``: what is to be named by kind, "" where nothing is."""
    models = list(dict.fromkeys(r["model"] for r in rows))
    answered = [r for r in rows if r["exit"] == 0]
    beyond = [r for r in answered if r.get("error_mm") is not None and r["error_mm"] > FAILS_AT * r["sigma_mm"]]
    yield f"{len(rows)} runs, crashes {sum(r['exit'] == 70 for r in rows)} (reach 0)"
    yield f"answered with an error beyond {FAILS_AT:g} σ: {_rate([r in beyond for r in answered])} (reach 0)"
    for m in models:
        sound = [r for r in rows if _sound(r["kind"]) and r["model"] == m]
        values = [r["nees"] for r in sound if r.get("nees") is not None]
        wrongly = _rate([r["code"] != "ok" for r in sound])
        mean, spread = np.mean(values) if values else np.nan, np.sqrt(12 / max(len(values), 1))
        yield (
            f"{m}: sound cells refused, misfit or flagged {wrongly} (reach 1 %); "
            f"mean NEES {mean:.2f} ± {spread:.2f} (reach 5.6 … 6.4)"
        )
    sigma = {_cell(r): r["sigma_mm"] for r in rows if _sound(r["kind"]) and r.get("sigma_mm") is not None}
    faulty = [r for r in rows if not _sound(r["kind"])]
    small = [r for r in faulty if r["effect_mm"] is not None and r["effect_mm"] < EFFECT * sigma.get(_cell(r), 0.0)]
    yield f"faults of an effect below {EFFECT:g} σ refused: {_rate([r['exit'] == 3 for r in small])} (reach 5 %)"
    flagged = [r for r in faulty if r["code"] not in ("ok", "CRASH") and culprits[r["kind"]]]
    yield f"the culprit rightly named: {_rate([named(r, culprits) for r in flagged])} (reach 90 %)"
    yield f"{'kind':16s} {'model':12s} ok flag exit3 beyond named  error/σ: median, largest"
    for kind in dict.fromkeys(r["kind"] for r in rows):
        for m in models:
            here = [r for r in rows if r["kind"] == kind and r["model"] == m]
            ratio = [r["error_mm"] / r["sigma_mm"] for r in here if r["exit"] == 0 and r.get("sigma_mm")]
            flags = [r for r in here if r["code"] != "ok"]
            yield (
                f"{kind:16s} {m:12s} {sum(r['code'] == 'ok' for r in here):2d} "
                f"{sum(r['exit'] == 0 and r['code'] != 'ok' for r in here):4d} {sum(r['exit'] == 3 for r in here):5d} "
                f"{sum(r in beyond for r in here):6d} {sum(named(r, culprits) for r in flags):3d}/{len(flags):<3d} "
                + (f"{np.median(ratio):6.2f} {max(ratio):6.2f}" if ratio else "     –")
            )


def named(r: dict[str, object], culprits: dict[str, str]) -> bool:
    """Whether the culprit, or one that can not be told from it, is the one."""
    wanted = culprits[r["kind"]]
    if wanted == "frames":
        return r["code"] == "frames_contradict" or "frame" in str(r["text"])
    return any(wanted in name for group in r.get("culprit", [])[:1] for name in group)


def _sound(kind: str) -> bool:
    return kind.rpartition(" ")[2] == SOUND


def _cell(r: dict[str, object]) -> tuple[str, int, str]:
    """What the sound cell has in common with a faulty one: target, seed, model."""
    return str(r["kind"]).rpartition(" ")[0], r["seed"], r["model"]


Run = Callable[[int, str, tuple[str, ...]], list[dict[str, object]]]


def asked(run: Run, culprits: dict[str, str], models: tuple[str, ...], store: str) -> None:
    """What the command line asks for: run what is missing of all kinds, print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--models", default=",".join(models))
    parser.add_argument("--kinds", default=".*")
    parser.add_argument("--store", type=Path, default=Path(store))
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    given = parser.parse_args()
    models = tuple(given.models.split(","))
    rows = [json.loads(line) for line in given.store.read_text().splitlines()] if given.store.exists() else []
    done = {(r["seed"], r["kind"], r["model"]) for r in rows}
    kinds = [k for k in culprits if re.fullmatch(given.kinds, k)]
    jobs = []
    for seed in range(given.seed, given.seed + given.cells):
        for kind in kinds:
            missing = tuple(m for m in models if (seed, kind, m) not in done)
            jobs += [(seed, kind, missing)] if missing else []
    with ProcessPoolExecutor(given.workers) as pool, given.store.open("a") as lines:
        for found in pool.map(run, *zip(*jobs, strict=True)) if jobs else ():
            rows += found
            lines.writelines(json.dumps(r) + "\n" for r in found)
            lines.flush()
    print("\n".join(table(rows, culprits)))


if __name__ == "__main__":
    asked(run, {kind: culprit for kind, (_, culprit) in KINDS.items()}, MODELS, "calib_faults.jsonl")
