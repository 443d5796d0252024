"""String spots of path-traced cells: missed ones, and the error of the axis points over the variance stated.

    python benchmarks/extraction_pathtraced.py [--cells 4] [--first 1] [--frames 12] [--draws 1] [--keep FOLDER]

Mitsuba 3 (pip install mitsuba) draws the light, an oracle of this script and its like alone: nothing of the emulator
takes part. A cell of a seed has a thread of its own (matte, dielectric-coated or metallic, thin or thick), lens blur,
speckle of its own grain and contrast, exposure, ambient light, and in most cells posts, plates or a wall behind. Whole
frames are traced coarsely, the strings' surroundings finely and in sub-pixels, where blur and speckle are laid over
them; then shot noise, read noise and 8 bits. DRAWS is how often: each draw is another recording of the same views, and
learns its speckle anew. The laser's sheet is an angle of light through a slit, not the emulator's
beam with a waist. FOLDER keeps traced frames, which are then not traced again.

Extraction is by default, its speckle learnt as `calibrate` learns it. Spots are named by truth (labelling is not tried)
and carried to the axis with the true direction of the string; "visible" are those of whose lit patch 0.9 or more is
seen by laser and camera, by rays. The error is that of the axis point; those without a flag count.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import CalibConfig
from calib.label.refine import take
from calib.label.surface_offset import axis_points
from calib.synthetic.cell import Layout, default_sensor, views
from extraction import ExtractionConfig, extract
from geometry import Pose, Sensor
from geometry.sensor import project
from jig_cad import Jig
from workbench.cell import dataset_config
from workbench.compare import VISIBLE

Array = NDArray[np.float64]

GATE_PX = 8.0  # a spot farther from where a string must be shows another thing
MARGIN_PX = 12.0  # spots nearer to the image's border are not asked for
APART_PX = 12.0  # nor are those that lie in one another
CROP, INNER, FINE = 25, 19, 3  # half sizes [px] of what is traced finely, and of what of it is used; sub-pixels
FINE_SPP, COARSE_SPP = 48, 3
DEPTH = 2  # light that bounces once more is faint here, and at few samples a pixel it would be single bright pixels
BITMAP = (16384, 48)  # of the projector: along and across the sheet
FAN_RAD = float(np.deg2rad(46.0))
AMBIENT_DN, FULL_WELL, READ_E, BLACK_DN = 1.5, 9000.0, 12.0, 4.0
AIRY = 0.45  # Gaussian width of a lens's diffraction, over the grain of the speckle that the same pupil leaves
SAID = "{:28s} {:4d} visible, {:2d} missed, {:3d} flagged, MSE/variance y {:4.2f}, z {:4.2f}, both {:4.2f}"


@dataclass(frozen=True)
class Look:
    """What a cell's images look like, drawn by its seed."""

    thread: str
    albedo: float
    gloss: float
    roughness: float
    diameter_mm: float
    sheet_rad: float  # 1/e² half-width of the laser's sheet
    blur_px: float
    grain_px: float
    looks: int  # independent speckle fields that are summed
    peak_dn: float
    clutter: str

    @staticmethod
    def of(seed: int) -> Look:
        """The look of a seed."""
        rng = np.random.default_rng([seed, 1])
        albedo, gloss, roughness = rng.uniform(0.1, 0.7), rng.uniform(0.1, 0.6), rng.uniform(0.12, 0.4)
        diameter, sheet = np.exp(rng.uniform(np.log(0.15), np.log(1.2))), rng.uniform(2.0e-4, 5.0e-4)
        aberration, grain = rng.uniform(0.3, 1.1), rng.uniform(0.5, 1.2)  # f/4 to f/8 at 660 nm, pixels of 5 µm
        return Look(
            thread=("matte", "coated", "metallic")[seed % 3],
            albedo=float(albedo),
            gloss=float(gloss),
            roughness=float(roughness),
            diameter_mm=float(diameter),
            sheet_rad=float(sheet),
            blur_px=float(np.hypot(AIRY * grain, aberration)),
            grain_px=float(grain),
            looks=int(rng.integers(1, 4)),
            peak_dn=float(rng.uniform(50.0, 200.0)),
            clutter=("none", "plates", "posts", "wall", "posts and wall")[int(rng.integers(5))],
        )

    def __str__(self) -> str:
        return f"{self.thread} {self.diameter_mm:.2f} mm, {self.clutter}"


@dataclass(frozen=True, eq=False)
class Traced:
    """A frame's light before lens and chip.

    coarse (H, W): of the whole image. fine: by string its corner and (n, n) of light in sub-pixels, None where it lies
    outside. seen (S,): the fraction of each string's lit patch that laser and camera see.
    """

    T_sensor_jig: Pose
    coarse: NDArray[np.float32]
    corners: NDArray[np.intp]
    fine: NDArray[np.float32]
    seen: Array


def cell_of(seed: int, frames: int) -> tuple[Sensor, Jig, Look, Pose]:
    """Sensor, jig, look and the jig's poses in the sensor."""
    look = Look.of(seed)
    jig = Jig.nominal(string_diameter_mm=look.diameter_mm)
    rng = np.random.default_rng([seed, 2])
    T_jig_sensor = views(rng, Layout(standoff_mm=(270.0, 330.0)), jig, frames)
    sensor = default_sensor().with_camera(black_level=BLACK_DN)
    return sensor, jig, look, T_jig_sensor.inverse()


def axes(jig: Jig, T: Pose) -> Array:
    """Where strings cross the sheet (S, 3) [mm]."""
    a, b = T @ jig.starts, T @ jig.ends
    return np.asarray(a - a[:, :1] / (b - a)[:, :1] * (b - a))


class Tracer:
    """Mitsuba, and the scene of a frame."""

    def __init__(self) -> None:
        import mitsuba

        mitsuba.set_variant("scalar_rgb")
        mitsuba.set_log_level(mitsuba.LogLevel.Error)
        self.mi = mitsuba

    def frame(self, sensor: Sensor, jig: Jig, look: Look, T: Pose, seed: int) -> Traced:
        """Trace one view."""
        scene = self.mi.load_dict(self.scene(sensor, jig, look, T))
        camera = sensor.require_camera()
        at = axes(jig, T)
        uv = project(camera, at)
        coarse = self.render(scene, self.camera(sensor, None), COARSE_SPP, seed)
        n = (2 * CROP + 1) * FINE
        fine = np.zeros((len(at), n, n), dtype=np.float32)
        corners = np.round(np.nan_to_num(uv, nan=-1e6)).astype(np.intp) - CROP
        for k, corner in enumerate(corners):
            if np.all(corner >= 0) and np.all(corner + 2 * CROP + 1 <= [camera.width_px, camera.height_px]):
                fine[k] = self.render(scene, self.camera(sensor, corner), FINE_SPP, seed + 7 * k + 1)
        seen = np.array([self.seen(scene, sensor, jig, look, T, k, p) for k, p in enumerate(at)])
        return Traced(T, coarse, corners, fine, seen)

    def render(self, scene: Any, sensor: Any, spp: int, seed: int) -> NDArray[np.float32]:
        """Light of a sensor's film."""
        found = self.mi.render(scene, sensor=self.mi.load_dict(sensor), spp=spp, seed=seed)
        return np.array(found)[..., 0].astype(np.float32)

    def seen(self, scene: Any, sensor: Sensor, jig: Jig, look: Look, T: Pose, k: int, at: Array) -> float:
        """Fraction of the matte light of a string's lit patch whose ways to emitter and camera are free."""
        d = T.R @ jig.directions[k]
        eyes = sensor.viewpoints_mm
        across = [e - at - (e - at) @ d * d for e in eyes]
        middle = sum(a / np.linalg.norm(a) for a in across)
        middle = middle / np.linalg.norm(middle)
        side, free, total = np.cross(d, middle), 0.0, 0.0
        for phi in np.linspace(-1.3, 1.3, 9):
            n = np.cos(phi) * middle + np.sin(phi) * side
            for x in (-0.5, 0.0, 0.5):
                p = at + look.diameter_mm / 2 * (n - d * n[0] / d[0]) + d / d[0] * x * look.sheet_rad * at[2]
                rays = [e - p for e in eyes]
                weight = float(np.prod([max(r @ n / np.linalg.norm(r), 0.0) for r in rays]))
                total += weight
                free += weight * all(self.free(scene, p + 2e-3 * n, e) for e in eyes)
        return free / total if total > 0 else 0.0

    def free(self, scene: Any, p: Array, eye: Array) -> bool:
        """Whether nothing lies between a point and an eye."""
        way = eye - p
        length = float(np.linalg.norm(way))
        ray = self.mi.Ray3f(p.tolist(), (way / length).tolist(), length * 0.999, 0.0, [])
        return not scene.ray_test(ray)

    def look_at(self, origin: Any, target: Any, up: Any) -> Any:
        """A frame of Mitsuba's."""
        o, t, u = (np.asarray(v, dtype=float).tolist() for v in (origin, target, up))
        return self.mi.ScalarTransform4f().look_at(origin=o, target=t, up=u)

    def camera(self, sensor: Sensor, corner: NDArray[np.intp] | None) -> dict[str, Any]:
        """The camera with the whole image as its film, or with the surroundings of a spot in sub-pixels."""
        c = sensor.require_camera()
        matrix, fine = c.T_sensor_camera.matrix, 1 if corner is None else FINE
        film: dict[str, Any] = {
            "type": "hdrfilm",
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
            "width": c.width_px * fine,
            "height": c.height_px * fine,
        }
        if corner is not None:
            film |= {"crop_offset_x": int(corner[0]) * fine, "crop_offset_y": int(corner[1]) * fine}
            film |= {"crop_width": (2 * CROP + 1) * fine, "crop_height": (2 * CROP + 1) * fine}
        eye, towards = matrix[:3, 3], matrix[:3, 2]
        return {
            "type": "perspective",
            "fov_axis": "x",
            "fov": float(np.rad2deg(2 * np.arctan(c.width_px / 2 / c.fx_px))),
            "principal_point_offset_x": float(((c.width_px - 1) / 2 - c.cx_px) / c.width_px),
            "principal_point_offset_y": float(((c.height_px - 1) / 2 - c.cy_px) / c.height_px),
            "near_clip": 1.0,
            "to_world": self.look_at(eye, eye + towards, -matrix[:3, 1]),
            "sampler": {"type": "independent", "sample_count": 16},
            "film": film,
        }

    def scene(self, sensor: Sensor, jig: Jig, look: Look, T: Pose) -> dict[str, Any]:
        """Strings, what stands about them, and the laser."""
        width, height = BITMAP
        step = 2 * np.tan(FAN_RAD / 2) / width
        across = (np.arange(height) - (height - 1) / 2) * step
        profile = np.exp(-2 * (across / look.sheet_rad) ** 2)
        bitmap = np.repeat(np.tile(profile[:, None, None], (1, width, 1)), 3, 2).astype(np.float32)
        out: dict[str, Any] = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": DEPTH},
            "laser": {
                "type": "projector",
                "to_world": self.look_at([0.0, 0, 0], [0.0, 0, 1.0], [1.0, 0, 0]),
                "fov": float(np.rad2deg(FAN_RAD)),
                "fov_axis": "x",
                "irradiance": {"type": "bitmap", "data": self.mi.TensorXf(bitmap), "raw": True},
                "scale": 1e4,
            },
        }
        thread = bsdf(look)
        for k, (a, b) in enumerate(zip(T @ jig.starts, T @ jig.ends, strict=True)):
            out[f"string {k}"] = {
                "type": "cylinder", "p0": a.tolist(), "p1": b.tolist(), "radius": look.diameter_mm / 2, "bsdf": thread,
            }  # fmt: skip
        return out | self.clutter(jig, look, T)

    def clutter(self, jig: Jig, look: Look, T: Pose) -> dict[str, Any]:
        """Plates at the strings' ends, two aluminium posts beside them, a wall behind."""
        to_world = self.mi.ScalarTransform4f(T.matrix.tolist())
        t, grey = self.mi.ScalarTransform4f, {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.3}}
        metal = {"type": "roughconductor", "material": "Al", "alpha": 0.25}
        out: dict[str, Any] = {}
        if look.clutter != "none":
            for name, x in (("bottom", -4.0), ("top", jig.height_mm + 4.0)):
                place = to_world @ t().translate([x, 0.0, 43.0]) @ t().scale([3.5, 62.0, 55.0])
                out[name] = {"type": "cube", "to_world": place, "bsdf": grey}
        if "posts" in look.clutter:
            for y in (-68.0, 68.0):
                a, b = (T @ np.array([[x, y, 60.0]]) for x in (-5.0, jig.height_mm + 5.0))
                out[f"post {y:g}"] = {
                    "type": "cylinder", "p0": a[0].tolist(), "p1": b[0].tolist(), "radius": 5.0, "bsdf": metal,
                }  # fmt: skip
        if "wall" in look.clutter:
            place = to_world @ t().translate([50.0, 0.0, 330.0]) @ t().scale([600.0, 600.0, 1.0])
            out["wall"] = {"type": "cube", "to_world": place, "bsdf": grey}
        return out


def bsdf(look: Look) -> dict[str, Any]:
    """The thread: matte, coated, or matte with a metallic lobe."""
    colour = {"type": "rgb", "value": look.albedo}
    matte = {"type": "diffuse", "reflectance": colour}
    if look.thread == "matte":
        return matte
    if look.thread == "coated":
        return {"type": "roughplastic", "distribution": "ggx", "alpha": look.roughness, "diffuse_reflectance": colour,
                "nonlinear": True}  # fmt: skip
    metal = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": look.roughness}
    return {"type": "blendbsdf", "weight": look.gloss, "a": matte, "b": metal}


def traced_cell(seed: int, frames: int, keep: Path | None) -> list[Traced]:
    """The cell's frames, from FOLDER where they are."""
    sensor, jig, look, Ts = cell_of(seed, frames)
    out: list[Traced] = []
    tracer: Tracer | None = None
    for k in range(frames):
        path = None if keep is None else keep / f"cell{seed}_{k}.npz"
        if path is not None and path.exists():
            with np.load(path) as file:
                out.append(Traced(Ts[k], file["coarse"], file["corners"], file["fine"], file["seen"]))
            continue
        tracer = tracer or Tracer()
        out.append(tracer.frame(sensor, jig, look, Ts[k], 1000 * seed + 50 * k))
        if path is not None:
            f = out[-1]
            np.savez_compressed(path, coarse=f.coarse, corners=f.corners, fine=f.fine, seen=f.seen)
    return out


def speckle(shape: tuple[int, int], grain: float, looks: int, rng: np.random.Generator) -> Array:
    """Intensity of mean 1 of ``looks`` fields that a round pupil leaves, its grain in samples."""
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1])
    pupil = np.hypot(fy, fx) <= 0.5 / max(grain, 1.0)
    total = np.zeros(shape)
    for _ in range(looks):
        field = np.fft.ifft2(np.fft.fft2(rng.normal(size=shape) + 1j * rng.normal(size=shape)) * pupil)
        total += np.abs(field) ** 2
    return np.asarray(total / total.mean())


def photographed(f: Traced, look: Look, light_to_e: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Lens blur, speckle, chip."""
    coarse = cv2.GaussianBlur(f.coarse, (0, 0), look.blur_px).astype(float)
    coarse *= speckle(coarse.shape, look.grain_px, look.looks, rng)
    for corner, part in zip(f.corners, f.fine, strict=True):
        if not part.any():
            continue
        fine = cv2.GaussianBlur(part, (0, 0), look.blur_px * FINE).astype(float)
        fine *= speckle(fine.shape, look.grain_px * FINE, look.looks, rng)
        n = 2 * CROP + 1
        pixels = fine.reshape(n, FINE, n, FINE).mean((1, 3))
        inner = slice(CROP - INNER, CROP + INNER + 1)
        u, v = corner + CROP - INNER
        coarse[v : v + 2 * INNER + 1, u : u + 2 * INNER + 1] = pixels[inner, inner]
    e = coarse * light_to_e + AMBIENT_DN / 255 * FULL_WELL
    e = np.minimum(rng.poisson(e), FULL_WELL) + rng.normal(size=e.shape) * READ_E
    return np.clip(np.round(e / FULL_WELL * (255 - BLACK_DN) + BLACK_DN), 0, 255).astype(np.uint8)


def exposure(frames: list[Traced], look: Look) -> float:
    """Electrons for a unit of light: the middle string peaks at the look's grey level."""
    peaks = [
        cv2.GaussianBlur(part, (0, 0), look.blur_px * FINE).max()
        for f in frames
        for part, seen in zip(f.fine, f.seen, strict=True)
        if part.any() and seen >= VISIBLE
    ]
    return float(look.peak_dn / 255 * FULL_WELL / np.median(peaks))


@dataclass(frozen=True, eq=False)
class Score:
    """Visible strings and what became of them; ratio (N, 2): squared errors of y and z over their variances."""

    look: Look
    visible: int
    missed: tuple[str, ...]
    flagged: int
    ratio: Array
    mahalanobis: Array

    def __str__(self) -> str:
        y, z = self.ratio.mean(axis=0) if len(self.ratio) else (np.nan, np.nan)
        both = self.mahalanobis.mean() / 2 if len(self.mahalanobis) else np.nan
        return SAID.format(str(self.look), self.visible, len(self.missed), self.flagged, y, z, both)


def scored(seed: int, frames: int, draws: int, keep: Path | None) -> Score:
    """Trace a cell, photograph and extract it ``draws`` times."""
    sensor, jig, look, _ = cell_of(seed, frames)
    traced = traced_cell(seed, frames, keep)
    light = exposure(traced, look)
    visible = flagged = 0
    missed: list[str] = []
    ratio, mahalanobis = [], []
    for draw in range(draws):
        rng = np.random.default_rng([seed, 3, draw] if draw else [seed, 3])
        images = [photographed(f, look, light, rng) for f in traced]
        config = dataset_config(sensor, ExtractionConfig(), len(images), lambda some: [images[i] for i in some])  # noqa: B023
        for n, (f, image) in enumerate(zip(traced, images, strict=True)):
            spots = extract(image, sensor, config)
            at = axes(jig, f.T_sensor_jig)
            uv = project(sensor.require_camera(), at)
            for k, name in enumerate(jig.strings):
                if not asked(k, uv, f, sensor):
                    continue
                visible += 1
                away = np.linalg.norm(spots.uv_px - uv[k], axis=1)
                i = int(np.argmin(away)) if len(away) else -1
                if i < 0 or away[i] > GATE_PX + look.diameter_mm * 8:
                    missed.append(f"draw {draw}, frame {n} {name} at ({uv[k, 0]:.0f}, {uv[k, 1]:.0f})")
                elif spots.flag[i]:
                    flagged += 1
                else:
                    taken = take(spots, np.array([i]))
                    yz, cov = axis_points(taken, [name], jig, sensor, f.T_sensor_jig, CalibConfig())
                    error = yz[0] - at[k, 1:]
                    ratio.append(error**2 / np.diag(cov[0]))
                    mahalanobis.append(float(error @ np.linalg.solve(cov[0], error)))
    return Score(look, visible, tuple(missed), flagged, np.array(ratio).reshape(-1, 2), np.array(mahalanobis))


def asked(k: int, uv: Array, f: Traced, sensor: Sensor) -> bool:
    """Whether a string must be found: seen whole, inside the image, apart from the others."""
    camera = sensor.require_camera()
    inside = np.all((uv[k] > MARGIN_PX) & (uv[k] < np.array([camera.width_px, camera.height_px]) - MARGIN_PX))
    others = np.delete(uv, k, axis=0)
    apart = np.nanmin(np.linalg.norm(others - uv[k], axis=1)) > APART_PX
    return bool(inside and apart and f.seen[k] >= VISIBLE and f.fine[k].any())


def main() -> None:
    """Score the cells and print a line each, and all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=4)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--draws", type=int, default=1, help="recordings of each cell")
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    cv2.setNumThreads(1)
    if given.keep is not None:
        given.keep.mkdir(parents=True, exist_ok=True)
    scores = []
    for seed in range(given.first, given.first + given.cells):
        scores.append(scored(seed, given.frames, given.draws, given.keep))
        print(f"{seed:3d} {scores[-1]}", *scores[-1].missed, sep="\n      ", flush=True)
    ratio = np.concatenate([s.ratio for s in scores])
    both = np.concatenate([s.mahalanobis for s in scores])
    print(
        f"all: {sum(s.visible for s in scores)} visible, {sum(len(s.missed) for s in scores)} missed, "
        f"{sum(s.flagged for s in scores)} flagged; MSE/variance {ratio.mean():.2f}, "
        f"Mahalanobis / 2 {both.mean() / 2:.2f}"
    )


if __name__ == "__main__":
    main()
