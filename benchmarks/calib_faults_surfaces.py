"""Is a wrong number in a file ever passed in silence where a ball, plates or a wedge are measured by profiles?

Run: python benchmarks/calib_faults_surfaces.py, with the options and the store of benchmarks/calib_faults.py.
Profiles are where the sheet's rays meet exact geometry, by calib/synthetic/surfaces.py, which knows nothing of the
solver: three places of nine views to calibrate, and one of eight that is not used, where predictions are compared.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from zlib import crc32

import numpy as np
from calib_faults import (
    GROUPS,
    JOINT_RAD,
    SOUND,
    Observed,
    asked,
    encoder,
    error_and_sigma,
    gear,
    late,
    one_joint,
    one_location,
    open_directions,
    predicted,
    row,
    too_sure,
)

from calib import CalibConfig, CalibrationResult, calibrate
from calib.printed import nees
from calib.synthetic.surfaces import ProfileNoise, SurfaceCell, observe_surface, section_points, surface_cell
from geometry import DhRobot, Frame, Surface
from jig_cad import Plane, Sphere, Wedge

NOISE = ProfileNoise(correlation=0.5)
POINTS, PREDICTED = 300, 12
TARGETS: dict[str, Surface] = {"ball": Sphere(40.0), "plate": Plane(), "wedge": Wedge(90.0)}


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the files say; joints (F, 6) as read. scale (2,), shift (2,): what was done to the profiles' y and z."""

    robot: DhRobot
    target: Surface
    joints: np.ndarray
    locations: tuple[str, ...]
    scale: tuple[float, float] = (1.0, 1.0)
    copies: int = 1


Fault = Callable[..., tuple]  # of (None, what the files say, rng): the same with a fault


def _diameter(world: None, files: Recorded, rng: np.random.Generator) -> tuple[None, Recorded]:
    if not isinstance(files.target, Sphere):
        return world, files
    off = float(rng.choice([-1, 1]) * rng.uniform(0.1, 0.5))
    return world, replace(files, target=Sphere(files.target.diameter_mm + off))


def _scaled(axis: int) -> Fault:
    def fault(world: None, files: Recorded, rng: np.random.Generator) -> tuple[None, Recorded]:
        scale = [1.0, 1.0]
        scale[axis] += float(rng.choice([-1, 1]) * rng.uniform(2e-3, 1e-2))
        return world, replace(files, scale=(scale[0], scale[1]))

    return fault


KINDS: dict[str, tuple[Fault, str]] = {SOUND: (lambda w, f, rng: (w, f), "")}
KINDS |= {f"{g}{i + 1}": (row(g, i), f"{g}{i + 1}") for g in GROUPS for i in range(1, 5)}
KINDS |= {f"encoder{i + 1}": (encoder(i), f"theta{i + 1}") for i in range(6)}
KINDS |= {f"gear{i + 1}": (gear(i), f"reading_scale{i + 1}") for i in range(6)}
KINDS |= {
    "diameter": (_diameter, ""),
    "scale_y": (_scaled(0), ""),  # a camera's file, as here, has no such number: its plane is accused
    "scale_z": (_scaled(1), ""),
    "late": (late, "frames"),
    "one_joint": (one_joint, ""),
    "one_location": (one_location, ""),
    "too_sure": (too_sure, "uncertainty"),
}


@lru_cache(maxsize=1)
def world_of(target: str, seed: int) -> tuple[SurfaceCell, tuple[Frame, ...], np.ndarray]:
    """A cell, its frames with the readings as they are, and the true joints (F, 6)."""
    cell = surface_cell(TARGETS[target], np.random.default_rng([seed, crc32(target.encode())]), noise=NOISE)
    rng = np.random.default_rng(1000 + seed)
    seen = observe_surface(cell, rng, NOISE, POINTS, labelled=False)
    again = np.random.default_rng(1000 + seed)  # the first that it draws
    return cell, seen.frames, cell.joints_rad + again.normal(size=cell.joints_rad.shape) * JOINT_RAD


def observe(cell: SurfaceCell, given: tuple[Frame, ...], files: Recorded, true_joints: np.ndarray) -> Observed:
    """Frames as the files would give them, and points of the unused place with where they truly are."""
    frames = tuple(
        replace(
            f,
            location=files.locations[f.number],
            joints_rad=files.joints[f.number],
            axis=replace(f.axis, yz_mm=f.axis.yz_mm * files.scale),
        )
        for f in given
    )
    unused = [f.number for f in given if f.role == "verify"]
    chain = cell.built.pose(true_joints) @ cell.T_hand_sensor
    yz, base = [], []
    for i in unused:
        seen = section_points(cell.target, chain[i].inverse() @ cell.T_base_target[cell.location[i]], POINTS)[0]
        points = seen[np.linspace(0, len(seen) - 1, PREDICTED).astype(int)]
        yz.append(points)
        base.append(chain[i] @ np.column_stack([np.zeros(len(points)), points]))
    return Observed(frames, files.joints[unused], np.array(yz) * files.scale, np.array(base))


def solved(files: Recorded, seen: Observed, cell: SurfaceCell, config: CalibConfig) -> CalibrationResult:
    """The answer to what the files say."""
    from calib.synthetic.cell import default_sensor

    return calibrate(seen.frames, files.target, files.robot, default_sensor(), cell.design, None, config)


def plain_error(files: Recorded, seen: Observed, cell: SurfaceCell) -> np.ndarray | None:
    """The error of prediction of an answer that nothing contradicts, whatever the data say."""
    config = CalibConfig(pull_limit=1e6, misfit_chi2=1e6)
    estimate = solved(files, seen, cell, config).estimate
    if estimate is None or estimate.robot is None:
        return None
    points = predicted(estimate.T_hand_sensor, estimate.robot, seen.joints, seen.yz_mm)
    out = open_directions(files.robot, seen.joints, points)
    error = (points - seen.true_mm).ravel()
    return error - out @ (out.T @ error)


@lru_cache(maxsize=1)
def sound_error(target: str, seed: int) -> np.ndarray | None:
    """plain_error of the cell without a fault."""
    cell, given, true_joints = world_of(target, seed)
    files = Recorded(cell.robot, cell.target, cell.joints_rad, cell.location)
    return plain_error(files, observe(cell, given, files, true_joints), cell)


def run(seed: int, called: str, models: tuple[str, ...]) -> list[dict[str, object]]:
    """One cell with one fault by all models."""
    target, kind = called.split()
    cell, given, true_joints = world_of(target, seed)
    sound = Recorded(cell.robot, cell.target, cell.joints_rad, cell.location)
    bad = KINDS[kind][0](None, sound, np.random.default_rng([seed, crc32(kind.encode())]))[1]
    seen = observe(cell, given, bad, true_joints)
    effect = None
    if kind != SOUND:
        without, with_it = sound_error(target, seed), plain_error(bad, seen, cell)
        if without is not None and with_it is not None:
            effect = float(np.sqrt(np.mean((with_it - without) ** 2)))
    rows: list[dict[str, object]] = []
    for model in models:
        r: dict[str, object] = {"seed": seed, "kind": called, "model": model, "effect_mm": effect}
        try:
            result = solved(bad, seen, cell, CalibConfig(model=model))
            r |= {"code": result.verdict.code, "text": result.verdict.text}
            r |= {"exit": 0 if result.verdict.trustworthy else 3, "chi2": result.chi2_per_dof}
            r |= {"culprit": [[c.parameter, *c.same_as] for c in result.culprit]}
            if result.trusted is not None:
                error, sigma = error_and_sigma(result, bad, seen)
                r |= {"sigma_mm": sigma, "error_mm": float(np.sqrt(np.mean(error**2)))}
                r |= {"nees": nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance)}
        except Exception as error:  # noqa: BLE001 # a crash is a figure of this benchmark
            r |= {"code": "CRASH", "exit": 70, "text": f"{error!r} {traceback.format_exc()[-800:]}"}
        rows.append(r)
    return rows


if __name__ == "__main__":
    every = {f"{t} {kind}": culprit for t in TARGETS for kind, (_, culprit) in KINDS.items()}
    asked(run, every, ("auto",), "calib_faults_surfaces.jsonl")
