"""A sensor's calibration beside OpenCV's calibrateCamera with a plane fitted afterwards, on the same pictures.

    python benchmarks/calibrate_sensor.py FOLDER board.toml

Left out: the camera and the plane from the other views, the left-out board's pose from its corners alone.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.sensor import BoardView
from geometry import Board
from workbench.files import ViewFiles, find_views, read_board, read_image
from workbench.sensor import calibrate_recording, read_recording

Array = NDArray[np.float64]


def peer_corners(files: ViewFiles, board: Board, sensor: object) -> Array | None:
    """OpenCV's corners (N, 2) of a view, refined by cornerSubPix."""
    image = read_image(files.board, sensor, lossy=True)  # type: ignore[arg-type]
    found, corners = cv2.findChessboardCorners(image, (board.columns, board.rows))
    if not found:
        return None
    rule = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-5)
    return cv2.cornerSubPix(image, corners, (11, 11), (-1, -1), rule).reshape(-1, 2)


def plane_of(points: Array) -> tuple[Array, Array]:
    """Middle and normal of points (N, 3)."""
    middle = points.mean(axis=0)
    return middle, np.linalg.svd(points - middle, full_matrices=False)[2][-1]


def on_board(K: Array, d: Array, rvec: Array, tvec: Array, uv: Array) -> Array:
    """Where pixels' rays meet a board (N, 3)."""
    xy = cv2.undistortPointsIter(uv.reshape(-1, 1, 2), K, d, None, None, (3, 50, 1e-12)).reshape(-1, 2)
    q = np.column_stack([xy, np.ones(len(xy))])
    normal = cv2.Rodrigues(rvec)[0][:, 2]
    return q * ((normal @ tvec.ravel()) / (q @ normal))[:, None]


def peer(corners: list[Array], views: list[BoardView], board: Board, size: tuple[int, int]) -> tuple[float, float]:
    """Reprojection [px] over all views, and left-out distances of the stripes from the plane [mm]."""
    xyz = np.column_stack([board.points_mm, np.zeros(len(board.points_mm))]).astype(np.float32)
    usual = [c.astype(np.float32) for c in corners]
    rms = cv2.calibrateCamera([xyz] * len(usual), usual, size, None, None)[0]
    off = []
    for k, view in enumerate(views):
        rest = [i for i in range(len(usual)) if i != k]
        _, K, d, rs, ts = cv2.calibrateCamera([xyz] * len(rest), [usual[i] for i in rest], size, None, None)
        seen = [on_board(K, d, r, t, views[i].stripe.uv_px) for i, r, t in zip(rest, rs, ts, strict=True)]
        middle, normal = plane_of(np.concatenate(seen))
        _, r, t = cv2.solvePnP(xyz, usual[k], K, d)
        off.append((on_board(K, d, r, t, view.stripe.uv_px) - middle) @ normal)
    return float(rms), float(np.sqrt(np.mean(np.concatenate(off) ** 2)))


def main(folder: str, board_file: str) -> None:
    """Print both."""
    board, files = read_board(Path(board_file)), find_views(Path(folder))
    recording = read_recording(files, board)
    result = calibrate_recording(recording)
    print(
        f"ours: {result.reprojection_rms_px:.4f} px, left-out plane {result.left_out_mm:.4f} mm, {result.verdict.code}"
    )
    by_name = {v.name: v for v in recording.views}
    both = [(peer_corners(f, board, recording.sensor), by_name[f.name]) for f in files if f.name in by_name]
    good = [(c, v) for c, v in both if c is not None and len(v.stripe)]
    camera = recording.sensor.require_camera()
    rms, off = peer([c for c, _ in good], [v for _, v in good], board, (camera.width_px, camera.height_px))
    print(f"OpenCV and a plane afterwards: {rms:.4f} px, left-out plane {off:.4f} mm")


if __name__ == "__main__":
    main(*sys.argv[1:3])
