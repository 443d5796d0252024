"""The pipeline: image → peaks → regions → spots → points of the laser sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.candidates import Candidates, find_candidates
from extraction.config import ExtractionConfig
from extraction.localise import Spots, localise, noise_model
from extraction.preprocess import Image32, Prepared, check_image, prepare
from extraction.rectify import image_to_sheet, propagate
from extraction.score import flag_spots, score_spots
from extraction.stages import Stages
from geometry import SensorModel, SurfacePoints

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Extraction:
    prepared: Prepared
    candidates: Candidates
    points: SurfacePoints
    candidate: NDArray[np.intp]


def extract(image: object, sensor: SensorModel, config: ExtractionConfig | None = None) -> SurfacePoints:
    """The lit string spots of an image as unlabelled points of the laser sheet, best score first.

    image: grey levels (H, W), uint8 or uint16. Raises InputError where image and sensor do not fit each other.
    """
    return _extract(image, sensor, config or ExtractionConfig()).points


def extract_stages(image: object, sensor: SensorModel, config: ExtractionConfig | None = None) -> Stages:
    """As `extract`, with all that it saw on the way."""
    config = config or ExtractionConfig()
    result = _extract(image, sensor, config)
    smooth = result.prepared.smooth
    background = _full_size(result.prepared.background, smooth.shape)
    noise = _full_size(result.prepared.noise, smooth.shape)
    mask = smooth > background + np.float32(config.detect.threshold) * noise
    reason = "" if len(result.points) else _why_empty(result.candidates)
    return Stages(result.prepared.image, background, mask, result.candidates, result.points, result.candidate, reason)


def _extract(image: object, sensor: SensorModel, config: ExtractionConfig) -> _Extraction:
    prepared = prepare(check_image(image, sensor), config.detect)
    candidates = find_candidates(prepared, config.detect, sheet_scale(sensor))
    spots = localise(prepared, candidates, sensor, noise_model(prepared, sensor, config), config)
    candidates = _refuse(candidates, spots, sensor)
    return _to_sheet(prepared, candidates, spots, sensor, config)


def sheet_scale(sensor: SensorModel) -> float:
    """Typical size of a pixel in the laser sheet [mm/px]: the median over a grid of the image."""
    u, v = np.meshgrid(np.linspace(0, sensor.width_px - 1, 5), np.linspace(0, sensor.height_px - 1, 5))
    _, jacobian = image_to_sheet(sensor, np.column_stack([u.ravel(), v.ravel()]))
    area = np.abs(np.linalg.det(jacobian))
    area = area[np.isfinite(area)]
    return float(np.sqrt(np.median(area))) if len(area) else 1.0


def _refuse(candidates: Candidates, spots: Spots, sensor: SensorModel) -> Candidates:
    """The candidates, with the reason of those that turned out to be no spots when they were localised."""
    reasons = list(candidates.reason)
    width = np.linalg.eigvalsh(spots.shape_px2)[:, 0]
    inside = np.all((spots.uv_px > -0.5) & (spots.uv_px < [sensor.width_px - 0.5, sensor.height_px - 0.5]), axis=1)
    moved = np.linalg.norm(spots.uv_px - candidates.mean_uv_px[spots.candidate], axis=1)
    for n, k in enumerate(spots.candidate):
        if not spots.converged[n] or not inside[n]:
            reasons[k] = "fit_failed"
        elif width[n] < 0.2:
            reasons[k] = "pixel_spike"
        elif moved[n] > 4.0:
            reasons[k] = "fit_wandered"
    return replace(candidates, reason=tuple(reasons))


def _to_sheet(
    prepared: Prepared, candidates: Candidates, spots: Spots, sensor: SensorModel, config: ExtractionConfig
) -> _Extraction:
    kept = np.flatnonzero([candidates.reason[k] == "" for k in spots.candidate])
    score = score_spots(candidates, spots, config)
    kept = kept[np.argsort(-score[kept], kind="stable")]
    kept = kept[score[kept] >= config.localise.min_score][: config.localise.max_spots]
    yz, jacobian = image_to_sheet(sensor, spots.uv_px[kept])
    seen = np.all(np.isfinite(yz), axis=1)
    kept, yz, jacobian = kept[seen], yz[seen], jacobian[seen]
    values, vectors = np.linalg.eigh(spots.shape_px2[kept])
    long = vectors[:, :, 1]
    axis = np.arctan2(long[:, 1], long[:, 0])
    axis = np.where(axis > np.pi / 2, axis - np.pi, np.where(axis <= -np.pi / 2, axis + np.pi, axis))
    flags = flag_spots(spots)
    points = SurfacePoints(
        spots.uv_px[kept], spots.cov_uv_px2[kept], yz, propagate(jacobian, spots.cov_uv_px2[kept]), score[kept], tuple(flags[n] for n in kept),
        axis, np.sqrt(values[:, ::-1]), spots.amplitude_dn[kept],
    )  # fmt: skip
    return _Extraction(prepared, candidates, points, spots.candidate[kept])


def _why_empty(candidates: Candidates) -> str:
    if not len(candidates):
        return "nothing stands above the noise: no laser in the image, or it is too dark"
    counts = {r: candidates.reason.count(r) for r in dict.fromkeys(candidates.reason) if r}
    return "every candidate was refused: " + ", ".join(f"{n} {r}" for r, n in counts.items())


def _full_size(blocks: Image32, shape: tuple[int, ...]) -> Image32:
    return np.asarray(cv2.resize(blocks, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR), dtype=np.float32)
