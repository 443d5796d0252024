"""The pipeline: image → peaks → regions → spots → points of the laser sheet."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.config import ExtractionConfig
from extraction.image import check_image
from extraction.reasons import Reason
from extraction.region import region_mask
from extraction.sheet import image_to_sheet, propagate
from extraction.spots.detect import Candidates, Image32, PreparedImage, find_candidates, prepare
from extraction.spots.error import MODEL_SHARE, SpotErrors, estimate_speckle, spot_errors
from extraction.spots.frame import Fits
from extraction.spots.localise import LocalisedSpots, localise
from extraction.spots.noise import noise_model
from extraction.spots.pair import take_apart
from extraction.spots.score import flag_spots, refuse_spots, score_spots
from extraction.spots.stages import Stages, left_out, why_empty
from geometry import Sensor, SurfacePoints

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Extraction:
    prepared: PreparedImage
    candidates: Candidates
    points: SurfacePoints
    candidate: NDArray[np.intp]
    errors: SpotErrors


def extract(
    image: object,
    sensor: Sensor,
    config: ExtractionConfig | None = None,
    remark: Callable[[str], None] | None = None,
) -> SurfacePoints:
    """The lit string spots of an image as unlabelled points of the laser sheet.

    Parameters
    ----------
    image
        Grey levels (H, W), uint8 or uint16, of the sensor's size.
    sensor
        A sensor with a camera.
    config
        Settings; the defaults where None.
    remark
        Told in a sentence each what a limit of number left out, and which setting holds it; and where dots lie too near
        to each other to be found.

    Returns
    -------
    points
        Best score first: pixels (u, v) and (y, z) in {P} [mm], each with its covariance, score and flag. No spot is an
        empty answer; `extract_stages` says why.

    Raises
    ------
    InputError
        Where image and sensor do not fit each other, or the sensor has no camera.

    References
    ----------
    docs/spots.md tells the stages and what they reach.
    """
    config = config or ExtractionConfig()
    result = _extract(image, sensor, config)
    if remark is not None:
        for sentence in left_out(result.prepared, result.candidates, config):
            remark(sentence)
    return result.points


def extract_stages(image: object, sensor: Sensor, config: ExtractionConfig | None = None) -> Stages:
    """As `extract`, with all that it saw on the way.

    Parameters
    ----------
    image, sensor, config
        As of `extract`.

    Returns
    -------
    stages
        Background, mask, every candidate with the reason of its refusal, the points, and why there are none.

    Raises
    ------
    InputError
        As `extract`.
    """
    config = config or ExtractionConfig()
    result = _extract(image, sensor, config)
    smooth = result.prepared.smooth
    background = _full_size(result.prepared.background, smooth.shape)
    noise = _full_size(result.prepared.noise, smooth.shape)
    mask = smooth > background + np.float32(config.detect.threshold) * noise
    reason = "" if len(result.points) else why_empty(result.prepared, result.candidates, sensor)
    return Stages(result.prepared.image, background, mask, result.candidates, result.points, result.candidate, reason)


def _extract(image: object, sensor: Sensor, config: ExtractionConfig) -> _Extraction:
    prepared = prepare(check_image(image, sensor), config.detect)
    usable = region_mask(config.region, prepared.image.shape)
    candidates = find_candidates(prepared, config.detect, sheet_scale(sensor), usable)
    noise = noise_model(prepared, sensor, config.noise)
    spots = take_apart(prepared, candidates, localise(prepared, candidates, noise, config), noise, config)
    yz_mm, jacobian = image_to_sheet(sensor, spots.uv_px)
    score = score_spots(candidates, spots, config)
    reasons = refuse_spots(candidates, spots, score, yz_mm, config)
    kept = np.flatnonzero(reasons == "")
    kept = kept[np.argsort(-score[kept], kind="stable")]
    reasons[kept[config.localise.max_spots :]] = Reason.BEYOND_MAX_SPOTS
    kept = kept[: config.localise.max_spots]
    errors = spot_errors(spots, kept, noise)
    reasons[kept[~errors.good]] = Reason.FIT_FAILED
    settled = np.flatnonzero(errors.good)
    kept, errors = kept[settled], errors[settled]
    points = _points(spots, kept, errors, yz_mm, jacobian, score, config)
    told = np.argsort(reasons == "", kind="stable")  # of two spots of one candidate the kept one speaks for it
    return _Extraction(
        prepared, candidates.refused(spots.candidate[told], reasons[told]), points, spots.candidate[kept], errors
    )


def learn_speckle(images: Iterable[object], sensor: Sensor, config: ExtractionConfig | None = None) -> ExtractionConfig:
    """The configuration with the speckle's contrast and grain as the trusted spots of all images show them.

    One image's few spots tell little of it; those of a dataset make the reported σ true.

    Parameters
    ----------
    images
        Grey levels (H, W) each, some of a dataset: thirty spots give the contrast to 6 %.
    sensor
        The sensor that took them.
    config
        Settings; what they state of contrast or grain is kept. The defaults where None.

    Returns
    -------
    config
        The same with `noise.speckle_contrast` and `noise.speckle_grain_px`; unchanged where no spot can be trusted.

    Raises
    ------
    InputError
        As `extract`.
    """
    config = config or ExtractionConfig()
    known: list[Fits] = []
    for image in images:
        result = _extract(image, sensor, config)
        flagged = np.array([flag != "" for flag in result.points.flag], dtype=np.bool_)
        good = np.flatnonzero(~flagged & (result.points.score > config.score.trusted) & result.errors.told)
        if result.errors.fits is not None and len(good):
            known.append(result.errors.fits[good])
    if not known:
        return config
    noise = config.noise
    own = MODEL_SHARE * noise.model_error
    speckle = estimate_speckle(known, own, noise.speckle_contrast, noise.speckle_grain_px)
    learnt = {"speckle_contrast": speckle.contrast, "speckle_grain_px": speckle.grain_px}
    return config.model_copy(update={"noise": noise.model_copy(update=learnt)})


@lru_cache(maxsize=8)
def sheet_scale(sensor: Sensor) -> float:
    """Typical size of a pixel in the laser sheet [mm/px]: the median over a grid of the image."""
    camera = sensor.require_camera()
    u, v = np.meshgrid(np.linspace(0, camera.width_px - 1, 5), np.linspace(0, camera.height_px - 1, 5))
    _, jacobian = image_to_sheet(sensor, np.column_stack([u.ravel(), v.ravel()]))
    with np.errstate(invalid="ignore"):  # pixels that a distorted lens does not reach see no place of the sheet
        area = np.abs(np.linalg.det(jacobian))
    area = area[np.isfinite(area) & (area > 0)]
    return float(np.sqrt(np.median(area))) if len(area) else 1.0


def _points(
    spots: LocalisedSpots,
    kept: NDArray[np.intp],
    errors: SpotErrors,
    yz_mm: Array,
    jacobian: Array,
    score: Array,
    config: ExtractionConfig,
) -> SurfacePoints:
    cov = errors.cov_uv_px2
    return SurfacePoints(
        uv_px=spots.uv_px[kept],
        cov_uv_px2=cov,
        yz_mm=yz_mm[kept],
        cov_yz_mm2=propagate(jacobian[kept], cov),
        score=score[kept],
        flag=tuple(map(str, flag_spots(spots, kept, errors, config.doubt))),
        axis_rad=spots.axis_rad[kept],
        sigma_px=np.sqrt(spots.variances_px2[kept, ::-1]),
        amplitude_dn=spots.amplitude_dn[kept],
    )


def _full_size(blocks: Image32, shape: tuple[int, ...]) -> Image32:
    return np.asarray(cv2.resize(blocks, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR), dtype=np.float32)
