"""RenderedFrame frames of a jig's strings and what extraction makes of them, for the benchmarks of σ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from extraction import ExtractionConfig, extract, image_to_sheet
from extraction.spots.detect import find_candidates, prepare
from extraction.spots.error import ErrorBudget
from extraction.spots.error import spot_errors as all_errors
from extraction.spots.localise import localise
from extraction.spots.noise import noise_model
from extraction.spots.pipeline import sheet_scale
from geometry import Pose, Sensor, SurfacePoints, exp_so3
from jig_cad import Jig
from perceptron_emu import EmulatorConfig, Material, RenderedFrame, Scene, render
from workbench.cell import find_emulator, find_sensor

Array = NDArray[np.float64]

SEEN, APART_PX, NEAR_PX, BORDER_PX = 0.9, 15.0, 4.0, 12.0
FAINT_E = 800.0  # a spot of fewer electrons peaks below 3 grey levels
TILT_DEG, SPREAD = (25.0, 25.0, 30.0), (0.09, 0.03, 0.09)  # of the jig's poses; of its place, over the distance


@dataclass(frozen=True)
class Emulated:
    """A sensor with its emulation."""

    name: str
    sensor: Sensor
    emulator: EmulatorConfig

    def plain(self) -> Emulated:
        """The same without speckle."""
        return replace(self, emulator=self.emulator.off("speckle"))


def optics(name: str) -> Emulated:
    """A preset; "nominal-0" is the nominal sensor whose dark pixels lie at grey level 0, "fine" one of 12 bits, 5
    million pixels of 3.45 µm.
    """
    preset = "nominal" if name in ("nominal-0", "fine") else name
    model = find_sensor(preset)
    emulator = find_emulator(preset)
    if name == "nominal-0":
        model = model.with_camera(black_level=0.0)
    if name == "fine":
        fine = {"width_px": 2448, "height_px": 2048, "cx_px": 1223.5, "cy_px": 1023.5, "fx_px": 4400.0, "fy_px": 4400.0}
        model = model.with_camera(**fine, bit_depth=12, black_level=60.0)
        emulator = emulator.model_copy(update={"optics": emulator.optics.model_copy(update={"pixel_um": 3.45})})
    return Emulated(name, model, emulator)


def random_thread(rng: np.random.Generator) -> Material:
    """A thread between matte white and dark glossy."""
    gloss = 0.0 if rng.uniform() < 0.3 else float(np.exp(rng.uniform(np.log(0.02), np.log(0.3))))
    return Material(float(rng.uniform(0.15, 0.7)), gloss, float(rng.uniform(0.15, 0.5)))


def scene(seen_by: Emulated, diameter_mm: float, rng: np.random.Generator) -> Scene:
    """The nominal jig with strings of a diameter and a random thread, in the middle of the view at a random pose."""
    sensor = seen_by.sensor
    middle = image_to_sheet(sensor, np.array([[sensor.camera.width_px / 2, sensor.camera.height_px / 2]]))[0][0]
    distance = float(np.linalg.norm(middle))
    centre = np.array([0.0, *middle]) + rng.uniform(-1, 1, 3) * SPREAD * distance
    rotation = exp_so3(rng.uniform(-1, 1, 3) * np.deg2rad(TILT_DEG))
    jig = Jig.nominal(string_diameter_mm=diameter_mm)
    return Scene(sensor, jig, Pose(rotation, centre - rotation @ [50.0, 0, 43.0]), string_material=random_thread(rng))


def frames(seen_by: Emulated, diameter_mm: float, count: int, rng: np.random.Generator) -> list[RenderedFrame]:
    """Frames of as many random poses."""
    return [render(scene(seen_by, diameter_mm, rng), seen_by.emulator, rng) for _ in range(count)]


def along_across(axis_rad: float) -> Array:
    """Rotation (2, 2) from the image's (u, v) to along and across a direction."""
    c, s = np.cos(axis_rad), np.sin(axis_rad)
    return np.array([[c, s], [-s, c]])


def matches(frame: RenderedFrame, points: SurfacePoints) -> Iterator[tuple[int, int]]:
    """String and spot of every well seen string, apart from others, whose spot has no flag."""
    size = np.array(frame.image.shape[::-1])
    seen = [(n, s) for n, s in enumerate(frame.truth.strings) if np.all(np.isfinite(s.image_px))]
    for n, string in seen:
        others = [np.linalg.norm(o.image_px - string.image_px) for m, o in seen if m != n]
        inside = np.all((string.image_px > BORDER_PX) & (string.image_px < size - 1 - BORDER_PX))
        alone = min(others, default=np.inf) > APART_PX
        if not (len(points) and inside and alone and string.visible_fraction > SEEN and string.electrons > FAINT_E):
            continue
        distance = np.linalg.norm(points.uv_px - string.image_px, axis=1)
        k = int(np.argmin(distance))
        if distance[k] < NEAR_PX and not points.flag[k]:
            yield n, k


def budgets(image: np.ndarray, sensor: Sensor, config: ExtractionConfig) -> tuple[np.ndarray, ErrorBudget | None]:
    """Positions and error budgets of all candidates that are fitted."""
    prepared = prepare(image, config.detect)
    candidates = find_candidates(prepared, config.detect, sheet_scale(sensor))
    noise = noise_model(prepared, sensor, config.noise)
    spots = localise(prepared, candidates, noise, config)
    return spots.uv_px, all_errors(spots, np.arange(len(spots)), noise).budget


def spot_errors(rendered: Sequence[RenderedFrame], sensor: Sensor, config: ExtractionConfig) -> tuple[Array, Array]:
    """Errors (N, 2) and variances (N, 2) along and across the light of all spots [px]."""
    errors, variances = [], []
    for frame in rendered:
        points = extract(frame.image, sensor, config)
        for n, k in matches(frame, points):
            turn = along_across(points.axis_rad[k])
            errors.append(turn @ (points.uv_px[k] - frame.truth.strings[n].image_px))
            variances.append(np.diag(turn @ points.cov_uv_px2[k] @ turn.T))
    return np.array(errors).reshape(-1, 2), np.array(variances).reshape(-1, 2)
