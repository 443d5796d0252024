"""Frames to validate on: views of the jig, nominal ones and ones whose conditions vary."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor, field_of_view
from geometry.sensor import SensorDeviation, stated_uncertainty
from jig_cad import Jig
from perceptron_emu import EmulatorConfig, Scene, Solid
from workbench.cell import jig_bodies, wall_behind
from workbench.plan import ViewLimits, free_views

Array = NDArray[np.float64]

GUESS_MM, GUESS_DEG = 3.0, 1.5  # how far off the robot chain's guess of the jig is before a calibration
CLUTTER = ("strings alone", "plates and posts", "and a wall")
FACTORS = ("exposure_ms", "ambient", "speckle", "diameter_mm", "gloss", "tilt_deg", "clutter", "signal_e")


@dataclass(frozen=True, eq=False)
class Drawn:
    """One frame to render. guess: of T_sensor_jig, as a robot gives it. factors: by the names of FACTORS.

    by_file: what sensor.toml says of the sensor, where the scene's was drawn from its uncertainty; else None.
    scale (2,): of its y and z, which no camera has.
    """

    number: int
    nominal: bool
    scene: Scene
    jig: Jig
    config: EmulatorConfig
    guess: Pose
    factors: dict[str, float]
    seed: tuple[int, int]
    by_file: Sensor | None = None
    scale: tuple[float, float] = (1.0, 1.0)


def draw_frames(sensor: Sensor, emulator: EmulatorConfig, jig: Jig, count: int, seed: int) -> Iterator[Drawn]:
    """``count`` frames as the files say, then ``count`` with varied conditions."""
    rng = np.random.default_rng([seed, 2**29])
    poses = free_views(sensor, jig, ViewLimits(mounting_deg=0.0), 2 * count, rng)
    bodies = (jig_bodies(jig), wall_behind(jig, 160.0, turn_deg=8.0))
    for number in range(2 * count):
        nominal = number < count
        config, mine, factors = emulator, jig, _as_given(emulator, jig)
        if not nominal:
            config, mine, factors = _varied(emulator, jig, rng)
        pose = poses[number]
        clutter = int(rng.integers(3))
        solids = (*(bodies[0] if clutter else ()), *((bodies[1],) if clutter == 2 else ()))
        factors |= {"tilt_deg": float(np.rad2deg(np.arccos(np.clip(pose.R[2, 2], -1, 1)))), "clutter": float(clutter)}
        xi = rng.standard_normal(6) * np.array([GUESS_MM] * 3 + [np.deg2rad(GUESS_DEG)] * 3)
        yield Drawn(
            number,
            nominal,
            _scene(sensor, mine, pose, solids),
            mine,
            config,
            Pose.exp(xi) @ pose,
            factors,
            (seed, number),
        )


def with_drawn_sensors(frames: Sequence[Drawn], count: int, seed: int) -> Iterator[Drawn]:
    """``count`` nominal frames anew, each by a sensor whose errors are drawn from its file's uncertainty.

    Nothing where the file takes itself for exact.
    """
    nominal = [f for f in frames if f.nominal]
    file = nominal[0].scene.sensor
    known = stated_uncertainty(file)
    if known is None:
        return
    rng = np.random.default_rng([seed, 2**30])
    _, basis = known.independent()
    deviation, places = SensorDeviation(file, known.parameters), _all_over(field_of_view(file))
    for i in range(count):
        frame = nominal[i % len(nominal)]
        values = basis @ rng.standard_normal(basis.shape[1])
        if known.tangent_covariance is not None:
            values = deviation.on_curve(places, values, known)
        change = dict(zip(known.parameters, values.tolist(), strict=True))
        scale = (1 + change.get("scale_y", 0.0), 1 + change.get("scale_z", 0.0))
        scene = replace(frame.scene, sensor=deviation.really(values))
        yield replace(
            frame, number=len(frames) + i, scene=scene, seed=(seed, len(frames) + i), by_file=file, scale=scale
        )


def _all_over(polygon: Array) -> Array:
    """Places (N, 2) in and at the rim of a convex polygon (K, 2)."""
    middle = polygon.mean(axis=0)
    return np.concatenate([middle + share * (polygon - middle) for share in (1 / 3, 2 / 3, 1.0)])


def _scene(sensor: Sensor, jig: Jig, pose: Pose, solids: tuple[Solid, ...]) -> Scene:
    placed = tuple(replace(s, T_sensor_mesh=pose @ s.T_sensor_mesh) for s in solids)
    return Scene(sensor, jig, pose, placed)


def _as_given(config: EmulatorConfig, jig: Jig) -> dict[str, float]:
    return {
        "exposure_ms": config.exposure.time_ms,
        "ambient": config.ambient.irradiance_mw_m2_nm if config.ambient.enabled else 0.0,
        "speckle": float("nan") if config.speckle.contrast is None else config.speckle.contrast,
        "diameter_mm": jig.string_diameter_mm,
        "gloss": config.surface.specular,
    }


def _varied(config: EmulatorConfig, jig: Jig, rng: np.random.Generator) -> tuple[EmulatorConfig, Jig, dict[str, float]]:
    """Conditions drawn over wide ranges about the given ones."""
    changes = {
        "exposure": {"time_ms": config.exposure.time_ms * float(10 ** rng.uniform(-0.7, 0.4))},
        "ambient": {"irradiance_mw_m2_nm": config.ambient.irradiance_mw_m2_nm * float(10 ** rng.uniform(-1, 0.7))},
        "speckle": {"contrast": float(rng.uniform(0.1, 1.0))},
        "surface": {"specular": float(rng.uniform(0, 0.25))},
    }
    varied = config.model_copy(
        update={name: getattr(config, name).model_copy(update=keys) for name, keys in changes.items()}
    )
    thread = replace(jig, string_diameter_mm=float(rng.uniform(0.2, 0.5)))
    return varied, thread, _as_given(varied, thread)
