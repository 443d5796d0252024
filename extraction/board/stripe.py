"""The laser's stripe on a board: where it can be trusted, away from the borders of squares, dots and markers."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.board.found import BoardCorners
from extraction.board.plane import board_homography, mapped
from extraction.board.print_alone import print_alone
from extraction.config import StripeConfig
from extraction.image import Image
from extraction.stripe import EDGE, SHAPE, StripePeaks, detect_stripe
from geometry import Board

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

REACH = 10.0  # pitches beyond the corners, in which a board's plane is followed: a plate larger than its print
BORDER_WIDTHS, BORDER_PX = (
    3.0,
    1.0,
)  # distance from a border of squares, dots or markers: Gaussian σ of the stripe, and pixels
ALIKE_SHARE = (
    0.3  # step of laser-on over laser-off levels from which the room light is in both: the laser itself makes 0.1
)
# of another stripe: its distance in Gaussian σ of the first, its light over the first's, and how straight it is
SECOND_WIDTHS, SECOND_LIGHT, SECOND_STRAIGHT_PX = 6.0, 0.1, 8.0
MIN_FIRST = 60  # points of the first that count at least: few points of another are none
# of the light of a room in two pictures: pixels that it is fitted to, and how many at least with how many levels; those
# that count, of their scatter; and what is the same light: the laser's own, scattered over a room, is a tenth
FITTED, FEWEST_FITTED, FEWEST_STEPS = 40_000, 200, 4
FIT_ROUNDS, FIT_SIGMAS, FULL_SHARE = 6, 3.0, 0.98
SAME_GAIN = 0.12
WIDEST_PX = 24.0  # Gaussian σ of a stripe that floods a board made bright for its corners


def stripe_on_board(
    image: Image, laser_off: Image | None, board: Board, corners: BoardCorners, config: StripeConfig | None = None
) -> StripePeaks:
    """The stripe's points on and about a board.

    Parameters
    ----------
    image
        Grey levels (H, W) with the stripe.
    laser_off
        The same view without it; subtracted where the room light is in both. Where there is none, what the print would
        show without the laser is drawn and subtracted, if more of the stripe is found with it.
    board, corners
        The board and where it was found.
    config
        Settings of the stripe.

    Returns
    -------
    peaks
        Points that are one peak, not cut by the image's border, and not beside one of squares, dots or markers, where a
        step of reflectance under the stripe draws its centre aside.
    """
    config = config or StripeConfig()
    settings = config.model_copy(update={"along_normal": True})
    found = _detected(image, laser_off, board, corners, settings)
    drawn = print_alone(image, board, corners) if laser_off is None else None
    if drawn is None:
        return found
    on_print = _points(image, drawn[0], board, corners, settings, drawn[1])
    return on_print if len(on_print) > len(found) else found


def second_stripe(image: Image, laser_off: Image, board: Board, corners: BoardCorners, first: StripePeaks) -> float:
    """Points of another stripe on a board, as a reflection draws it, over those of the first.

    Parameters
    ----------
    image, laser_off, board, corners
        As of `stripe_on_board`.
    first
        The stripe found there; it is looked for another where it is not.

    Returns
    -------
    share
        0 where nothing else is straight, of light enough and far from the first.
    """
    if len(first) < 3:
        return 0.0
    middle, along = _line(first.uv_px)
    v, u = np.mgrid[: image.shape[0], : image.shape[1]]
    away = np.abs((u - middle[0]) * along[1] - (v - middle[1]) * along[0])
    beside = away > SECOND_WIDTHS * float(np.median(first.width_px)) + SECOND_STRAIGHT_PX
    found = _detected(image, laser_off, board, corners, StripeConfig(), beside)
    h = board_homography(corners.uv_px, corners.xy_mm)
    margin = np.array([[-1.0], [1.0]]) * board.pitch_mm
    low, high = np.stack([corners.xy_mm.min(axis=0), corners.xy_mm.max(axis=0)]) + margin
    found, mine = (
        p[np.all((xy := mapped(h, p.uv_px)) > low, axis=1) & np.all(xy < high, axis=1)] for p in (found, first)
    )
    if len(found) < 3 or np.median(found.amplitude_dn) < SECOND_LIGHT * np.median(first.amplitude_dn):
        return 0.0
    middle, along = _line(found.uv_px)
    across = (found.uv_px - middle) @ [along[1], -along[0]]
    return float(np.sum(np.abs(across) < SECOND_STRAIGHT_PX)) / max(len(mine), MIN_FIRST)


def _line(uv: Array) -> tuple[Array, Array]:
    """A place and the direction of the straight line through points (N, 2)."""
    middle = np.median(uv, axis=0)
    off = uv - middle
    near = np.abs(off @ np.linalg.svd(off, full_matrices=False)[2][1]) < SECOND_STRAIGHT_PX
    off = off[near] if near.sum() > 2 else off
    return middle, np.linalg.svd(off, full_matrices=False)[2][0]


def _detected(
    image: Image,
    laser_off: Image | None,
    board: Board,
    corners: BoardCorners,
    config: StripeConfig,
    allowed: Mask | None = None,
) -> StripePeaks:
    h = board_homography(corners.uv_px, corners.xy_mm)
    mask = _near(image.shape, h, board, corners)
    off = laser_off if laser_off is not None and _lit_alike(image, laser_off, mask) else None
    off = None if off is None else as_lit(image, off, mask)
    return _points(image, off, board, corners, config, mask if allowed is None else mask & allowed)


def _points(
    image: Image, off: Image | None, board: Board, corners: BoardCorners, config: StripeConfig, places: Mask
) -> StripePeaks:
    widest = max(config.max_width_px, WIDEST_PX)
    peaks = detect_stripe(image, config.model_copy(update={"max_width_px": widest}), off, places)
    peaks = peaks[(peaks.flag & (EDGE | SHAPE)) == 0]
    h = board_homography(corners.uv_px, corners.xy_mm)
    return peaks[_clear(peaks, h, board, corners)] if len(peaks) else peaks


def room_light_in_both(image: Image, laser_off: Image, board: Board, corners: BoardCorners) -> bool:
    """Whether the picture with the stripe shows the board as the one without does."""
    h = board_homography(corners.uv_px, corners.xy_mm)
    return _lit_alike(image, laser_off, _near(image.shape, h, board, corners))


def _lit_alike(image: Image, laser_off: Image, mask: Mask) -> bool:
    """By the step from what is darker to what is brighter than the middle of the levels without, in both pictures.

    The middle of the range: where a small board stands before a dark room, most pixels are the room's.
    """
    off, on = laser_off[mask].astype(float)[::7], image[mask].astype(float)[::7]
    if len(off) < 100:
        return True
    low, high = np.percentile(off, [1, 99])
    if high - low < 4:
        return True
    bright = off > (low + high) / 2
    dark = ~bright
    step_off = np.median(off[bright]) - np.median(off[dark])
    step_on = np.median(on[bright]) - np.median(on[dark])
    return bool(step_on > ALIKE_SHARE * step_off)


def as_lit(image: Image, laser_off: Image, mask: Mask) -> Image:
    """The picture without laser, brought to the room light of the one with it: a + g times its levels.

    Both are fitted to the levels of the pixels that the room alone lights, by least squares without those that lie off
    by more than the others scatter: the stripe and its halo. The same picture where the light is the same.
    """
    at = np.flatnonzero(mask)[:: max(1, int(mask.sum()) // FITTED)]
    off, on = laser_off.ravel()[at].astype(float), image.ravel()[at].astype(float)
    top = np.iinfo(image.dtype).max
    good = (off < FULL_SHARE * min(top, off.max())) & (on < FULL_SHARE * min(top, on.max()))
    off, on = off[good], on[good]
    if len(off) < FEWEST_FITTED or np.ptp(off) < FEWEST_STEPS:
        return laser_off
    gain, shift = 1.0, 0.0
    kept = np.ones(len(off), dtype=bool)
    for _ in range(FIT_ROUNDS):
        gain, shift = np.polyfit(off[kept], on[kept], 1)
        left = on - gain * off - shift
        spread = 1.4826 * float(np.median(np.abs(left[kept] - np.median(left[kept]))))
        kept = np.abs(left) < max(FIT_SIGMAS * spread, 1.0)
        if kept.sum() < FEWEST_FITTED or np.ptp(off[kept]) < FEWEST_STEPS:
            return laser_off
    if abs(gain - 1) < SAME_GAIN:
        return laser_off
    scaled: Array = np.rint(np.clip(gain * laser_off.astype(np.float32) + shift, 0, top))
    return scaled.astype(np.uint8) if laser_off.dtype == np.uint8 else scaled.astype(np.uint16)


def _near(shape: tuple[int, ...], h: Array, board: Board, corners: BoardCorners) -> Mask:
    """Pixels of the board and of its surroundings."""
    low, high = corners.xy_mm.min(axis=0), corners.xy_mm.max(axis=0)
    margin = (REACH + 1.0) * board.pitch_mm
    box = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    box = box + margin * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    p = np.column_stack([box, np.ones(4)]) @ np.linalg.inv(h).T
    if np.any(p[:, 2] * p[0, 2] <= 0):  # the surroundings reach behind the camera
        return np.ones(shape, dtype=bool)
    polygon = np.round(np.clip(p[:, :2] / p[:, 2:], -30_000, 30_000)).astype(np.int32)
    out = np.zeros(shape, dtype=np.uint8)
    cv2.fillConvexPoly(out, polygon, 1)
    return out.astype(bool)


def _clear(peaks: StripePeaks, h: Array, board: Board, corners: BoardCorners) -> Mask:
    """Which points stand clear of the borders of squares, dots and markers."""
    p = np.column_stack([peaks.uv_px, np.ones(len(peaks))]) @ h.T
    xy = p[:, :2] / p[:, 2:]
    px_per_mm = np.sqrt(np.abs(p[:, 2]) ** 3 / np.abs(np.linalg.det(h)))
    distance_mm = (_border_distance if board.is_checkered else _rim_distance)(xy, board, corners)
    need = (BORDER_WIDTHS * peaks.width_px + BORDER_PX) / px_per_mm
    return np.asarray(distance_mm > need)


def _border_distance(xy: Array, board: Board, corners: BoardCorners) -> Array:
    """Distance [mm] from the nearest border between squares, the board as large as it may be, or of a marker."""
    pitch = board.pitch_mm
    low, high = corners.xy_mm.min(axis=0) - pitch, corners.xy_mm.max(axis=0) + pitch
    inside = np.clip(xy, low, high)
    off = np.linalg.norm(xy - inside, axis=1)
    grid = np.abs(inside - pitch * np.round(inside / pitch)).min(axis=1)
    distance = np.where(off > 0, off, grid)
    if corners.markers_mm is not None:
        from scipy.spatial import cKDTree  # a tenth of a second, and a window on strings needs none of it

        middle = corners.markers_mm[cKDTree(corners.markers_mm).query(xy, p=np.inf)[1]]
        beyond = np.maximum(np.abs(xy - middle) - board.marker_mm / 2, 0.0)
        distance = np.minimum(distance, np.linalg.norm(beyond, axis=1))  # inside a marker there are borders everywhere
    return np.asarray(distance)


def _rim_distance(xy: Array, board: Board, corners: BoardCorners) -> Array:
    """Distance [mm] from the nearest dot's rim."""
    from scipy.spatial import cKDTree

    nearest, _ = cKDTree(board.points_mm).query(xy)
    return np.asarray(np.abs(nearest - corners.dot_radius_mm))
