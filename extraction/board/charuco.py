"""ChArUco boards: markers name the corners, so that any part of the board will do."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.board.checkered import (
    MAX_MISFIT_SHARE,
    MAX_MOVE_SHARE,
    MIN_CONTRAST_SHARE,
    fitted_corners,
)
from extraction.board.found import BoardCorners, NoBoard
from geometry import Board, InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MIN_CORNERS = 6  # names make up for number


def _detected(image: NDArray[np.uint8], printed: cv2.aruco.CharucoBoard) -> tuple[Any, Any, Any]:
    """Corners, their numbers, and markers, as OpenCV finds them; None where there are none."""
    uv = ids = markers = None
    for legacy in (False, True):  # boards with an even number of rows were printed the other way before OpenCV 4.6
        printed.setLegacyPattern(legacy)
        uv, ids, _, markers = cv2.aruco.CharucoDetector(printed).detectBoard(image)
        if ids is not None and len(ids) >= MIN_CORNERS:
            break
    return uv, ids, markers


def find_charuco(image: NDArray[np.uint8], board: Board, usable: Mask) -> BoardCorners | NoBoard:
    """The corners of a ChArUco board in a picture of 8 bits (H, W)."""
    squares = (board.columns + 1, board.rows + 1)
    printed = cv2.aruco.CharucoBoard(squares, board.pitch_mm, board.marker_mm, dictionary(board.dictionary))
    uv, ids, markers = _detected(image, printed)
    if ids is None or len(ids) < MIN_CORNERS:
        again = _detected(np.ascontiguousarray(image[:, ::-1]), printed)[1]
        if again is not None and len(again) >= MIN_CORNERS:
            return NoBoard("the picture is mirrored: switch the flip in the camera's driver off")
        if markers is not None and len(markers):
            return NoBoard("markers were found but too few of the board's corners")
        return NoBoard("no marker of the board was found (is the dictionary right?)")
    xy = board.points_mm[ids.ravel()]
    start = uv.reshape(-1, 2).astype(float)
    # the window ends where the markers begin
    share = min(0.35, 0.9 * (board.pitch_mm - board.marker_mm) / (2 * board.pitch_mm) * np.sqrt(2))
    fit = fitted_corners(image, xy, start, share, board.pitch_mm, usable)
    contrast = float(np.median(np.abs(fit.contrast_dn)))
    good = fit.good & (np.abs(fit.contrast_dn) > MIN_CONTRAST_SHARE * contrast)
    good &= fit.misfit_dn < MAX_MISFIT_SHARE * np.abs(fit.contrast_dn)
    step = _step_px(xy, start, board.pitch_mm)
    good &= np.linalg.norm(fit.uv_px - start, axis=1) < max(MAX_MOVE_SHARE * step, 1.0)
    if good.sum() < MIN_CORNERS:
        return NoBoard("too few corners of the ChArUco board are clear")
    return BoardCorners(
        xy[good],
        fit.uv_px[good],
        fit.covariance_px2[good],
        float(np.median(fit.blur_px[good])),
        2 * contrast,
        markers_mm=np.array([np.mean(m, axis=0)[:2] for m in printed.getObjPoints()]) - board.pitch_mm,
        axes=True,
        named=True,
    )


def dictionary(name: str) -> cv2.aruco.Dictionary:
    """OpenCV's dictionary of markers.

    Parameters
    ----------
    name
        Such as "DICT_4X4_50"; the prefix may be left out.

    Returns
    -------
    dictionary
        Of OpenCV's own kind.

    Raises
    ------
    InputError
        Where it has none of that name.
    """
    key = name if name.startswith("DICT_") else f"DICT_{name}"
    number = getattr(cv2.aruco, key, None)
    if not isinstance(number, int):
        raise InputError(f'dictionary = "{name}" is none of OpenCV\'s, such as "DICT_4X4_50" or "DICT_5X5_100"')
    return cv2.aruco.getPredefinedDictionary(number)


def _step_px(xy: Array, uv: Array, pitch_mm: float) -> float:
    spread = np.linalg.norm(uv - uv.mean(axis=0), axis=1).mean()
    return float(pitch_mm * spread / max(np.linalg.norm(xy - xy.mean(axis=0), axis=1).mean(), 1e-9))
