"""Images of stripes measured one after another, with a sensor in millimetres, without one in pixels."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from extraction import Profile, StripePeaks, flag_names
from geometry import InputError, Remark, Sensor, no_remark
from workbench.cell.profiling import usable
from workbench.files import LOSSY_SUFFIXES, Settings, read_image, read_sensor, sensor_of_picture

if TYPE_CHECKING:
    from extraction import PieceEnds

Image = NDArray[np.uint8] | NDArray[np.uint16]

MOSAIC_RATIO = 1.6  # of the brightest of the four pixels of a mosaic's cell over the darkest, in what is lit
MOSAIC_LEVEL = 99.0  # percentile of grey levels from which a pixel's cell counts as lit
_POINT, _DOUBTED, _AMBIGUOUS = (0, 255, 0), (255, 120, 0), (0, 165, 255)  # of the overlay, BGR


@dataclass(frozen=True)
class StripeInputs:
    """What the images have in common: the sensor or none, laser-off image, mask, the channel and settings."""

    sensor: Path | None = None
    laser_off: Path | None = None
    mask: Path | None = None
    channel: str | None = None
    settings: Settings = field(default_factory=Settings)


@dataclass(frozen=True, eq=False)
class MeasuredStripe:
    """One image with what was found in it: peaks, with a sensor their points, the pieces' ends; ``reason`` for none."""

    path: Path
    image: Image
    peaks: StripePeaks
    profile: Profile | None
    reason: str
    ends: Sequence[PieceEnds] = ()


def stripe_images(paths: Sequence[Path]) -> list[Path]:
    """The image files that are named, and those of the folders that are; InputError where there are none."""
    out: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() in LOSSY_SUFFIXES)
            if not inside:
                raise InputError(f"{path}: holds no image ({', '.join(LOSSY_SUFFIXES)})")
            out += inside
        else:
            out.append(path)
    return out


def measure_stripes(
    paths: Sequence[Path],
    inputs: StripeInputs,
    remark: Remark = no_remark,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[MeasuredStripe]:
    """Measure image after image.

    Parameters
    ----------
    paths
        Image files.
    inputs
        Sensor, laser-off image, mask, channel and settings of all of them.
    remark
        Told what is doubtful; with several images also which of them can not be read: those are left out.
    progress
        Told how many are done, of how many.

    Yields
    ------
    measured
        In the order of the paths.

    Raises
    ------
    InputError
        Where the sensor, the laser-off image or the mask can not be used, or an image that stands alone.
    """
    sensor = None if inputs.sensor is None else with_channel(read_sensor(inputs.sensor), inputs.channel)
    said: set[str] = set()

    def once(text: str) -> None:
        what = text.split(": ", 1)[-1]
        if what not in said:
            said.add(what)
            remark(text if len(paths) == 1 else f"{text} (and perhaps others)")

    for k, path in enumerate(paths):
        try:
            yield _measure(path, sensor, inputs, once)
        except InputError as error:
            if len(paths) == 1:
                raise
            remark(f"{error}; left out")
        if progress is not None:
            progress(k + 1, len(paths))


def with_channel(sensor: Sensor, channel: str | None) -> Sensor:
    """The sensor with another channel of colour images, where one is given."""
    return sensor if channel is None else sensor.with_camera(channel=channel)


def _measure(path: Path, sensor: Sensor | None, inputs: StripeInputs, remark: Remark) -> MeasuredStripe:
    from extraction import detect_stripe, extract_profile, piece_ends

    model = sensor_of_picture(path, inputs.channel) if sensor is None else sensor
    image = read_image(path, model, remark, lossy=True)
    off = None if inputs.laser_off is None else read_image(inputs.laser_off, model, remark, lossy=True)
    mask = None if inputs.mask is None else read_image(inputs.mask, model, lossy=True) > 0
    if is_mosaic(image):
        remark(
            f"{path}: looks like a Bayer mosaic, colours side by side in one grey image; centres are drawn to one "
            "colour's pixels: save the image demosaiced or grey, or every second pixel of the laser's colour"
        )
    mask, config = usable(image, mask, inputs.settings), inputs.settings.stripe
    if sensor is None:
        peaks, profile = detect_stripe(image, config, off, mask), None
    else:
        profile = extract_profile(image, sensor, config, off, mask)
        peaks = profile.peaks
    reason = "" if len(peaks) else why_no_stripe(image, model, peaks, mask)
    return MeasuredStripe(path, image, peaks, profile, reason, piece_ends(image, peaks, off, mask))


def is_mosaic(image: Image) -> bool:
    """Whether lit pixels of the four places of a 2 × 2 cell differ as the colours of a mosaic do."""
    height, width = image.shape[0] // 2 * 2, image.shape[1] // 2 * 2
    if height < 16 or width < 16:
        return False
    cells = image[:height, :width].reshape(height // 2, 2, width // 2, 2).astype(np.float32)
    mean = cells.mean(axis=(1, 3))
    lit = mean >= max(float(np.percentile(mean, MOSAIC_LEVEL)), 1.0)
    levels = sorted(float(np.median(cells[:, a, :, b][lit])) for a in (0, 1) for b in (0, 1))
    # a stripe that lies along rows or columns makes pairs alike; in a mosaic one colour, or two, stands out alone
    alone = levels[3] > MOSAIC_RATIO * max(levels[2], 1.0) or levels[0] * MOSAIC_RATIO < levels[1]
    return alone and levels[3] > MOSAIC_RATIO * max(levels[0], 1.0)


def why_no_stripe(image: Image, sensor: Sensor, peaks: StripePeaks, mask: NDArray[np.bool_] | None = None) -> str:
    """Why there is no stripe: nothing of the image is looked at (mask), flooded, or what was seen and refused."""
    if mask is not None and not mask.any():
        size = f"{image.shape[1]} × {image.shape[0]}"
        return (
            f"no stripe: mask and region leave none of the image's {size} px; were they drawn for another image size?"
        )
    full = sensor.require_camera().saturation_dn
    if (image >= full).mean() > 0.5:
        return f"no stripe: more than half of the image is saturated ({full}), lower the exposure"
    if peaks.refused:
        seen = ", ".join(f"{n} {reason}" for reason, n in sorted(peaks.refused.items()))
        return f"no stripe: ridges were seen and refused ({seen})"
    return "no stripe in the image: see [stripe] direction, min_run, max_width_px"


def flag_counts(peaks: StripePeaks) -> dict[str, int]:
    """How many points have each flag."""
    flags: dict[str, int] = {}
    for bits in peaks.flag.tolist():
        for name in filter(None, flag_names(bits).split("+")):
            flags[name] = flags.get(name, 0) + 1
    return dict(sorted(flags.items()))


def stripe_record(measured: MeasuredStripe) -> dict[str, object]:
    """One image's entry of the JSON: what was found, refused and flagged, and its points."""
    peaks, profile = measured.peaks, measured.profile
    points: list[dict[str, object]] = []
    for i in range(len(peaks)):
        point: dict[str, object] = {
            "section": int(peaks.section[i]),
            "u_px": float(peaks.uv_px[i, 0]),
            "v_px": float(peaks.uv_px[i, 1]),
            "sigma_px": float(peaks.sigma_px[i]),
            "flag": flag_names(int(peaks.flag[i])),
        }
        if len(peaks.piece):
            point["piece"] = int(peaks.piece[i])
        if profile is not None:
            sigma = np.sqrt(np.maximum(np.diag(profile.cov_yz_mm2[i]), 0))
            point |= {"y_mm": float(profile.yz_mm[i, 0]), "z_mm": float(profile.yz_mm[i, 1])}
            point |= {"sigma_y_mm": float(sigma[0]), "sigma_z_mm": float(sigma[1])}
            if profile.sensor_cov_yz_mm2 is not None:
                y, z = np.sqrt(np.diag(profile.sensor_cov_yz_mm2[i])).tolist()
                point |= {"sigma_sensor_y_mm": y, "sigma_sensor_z_mm": z}
        points.append(point)
    rows = len(peaks) > 0 and abs(peaks.normal[0, 0]) > abs(peaks.normal[0, 1])
    return {
        "image": str(measured.path),
        "direction": None if len(peaks) == 0 else ("rows" if rows else "columns"),
        "n_points": len(peaks),
        "n_flagged": int((peaks.flag > 0).sum()),
        "n_pieces": int(peaks.piece.max()) + 1 if len(peaks.piece) else 0,
        "flags": flag_counts(peaks),
        "refused": dict(sorted(peaks.refused.items())),
        "correlation_sections": peaks.correlation_sections,
        "reason": measured.reason or None,
        "ends": [
            {
                "piece": e.piece,
                "first_section": e.first,
                "last_section": e.last,
                "begin_px": e.begin_px,
                "sigma_begin_px": e.sigma_begin_px,
                "end_px": e.end_px,
                "sigma_end_px": e.sigma_end_px,
            }
            for e in measured.ends
        ],
        "points": points,
    }


def stripe_overlay(measured: MeasuredStripe) -> NDArray[np.uint8]:
    """The image with its points: green; orange where ambiguous; blue where flagged otherwise (H, W, 3) BGR."""
    import cv2

    image = measured.image
    top = float(np.percentile(image, 99.9)) if image.dtype != np.uint8 else 255.0
    grey = np.clip(image.astype(np.float32) * (255.0 / max(top, 1.0)), 0, 255).astype(np.uint8)
    out = np.repeat(grey[:, :, None], 3, axis=2)
    u, v = np.round(measured.peaks.uv_px).astype(int).T if len(measured.peaks) else (np.zeros(0, int),) * 2
    inside = (u >= 0) & (u < image.shape[1]) & (v >= 0) & (v < image.shape[0])
    names = [flag_names(int(f)) for f in measured.peaks.flag]
    for i in np.flatnonzero(inside):
        colour = _POINT if not names[i] else (_AMBIGUOUS if "ambiguous" in names[i] else _DOUBTED)
        cv2.circle(out, (int(u[i]), int(v[i])), 1, colour, -1)
    return out
