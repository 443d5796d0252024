"""From pictures to a sensor that measures, for kinds of boards: against the lens and plane that made the pictures."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from extraction.sheet import image_to_sheet
from geometry import Board
from tests.workbench.board_pictures import DISTANCE_MM, LENS, NORMAL, K, pictured, pose_of
from workbench.cli.main import run
from workbench.files import board_text, read_sensor

BOARDS = (
    Board("charuco", 7, 5, 12.0, 8.0, "DICT_4X4_50"),
    Board("circles", 8, 6, 10.0),
    Board("asymmetric_circles", 4, 9, 8.0),
)
# tilts [rad], turn [rad] and middle [mm] of the boards: near and far, tilted both ways
POSES = (
    ((0.5, -0.3), 0.2, (4.0, -3.0, 280.0)),
    ((-0.5, 0.2), -0.3, (-6.0, 4.0, 296.0)),
    ((0.1, 0.55), 1.4, (3.0, 6.0, 270.0)),
    ((0.2, -0.5), 0.1, (-4.0, -8.0, 310.0)),
    ((-0.3, -0.4), 1.7, (8.0, 1.0, 288.0)),
    ((0.45, 0.35), -0.2, (0.0, 9.0, 262.0)),
)
REACHED_MM = 0.02  # of the mapping; a pixel is 0.25 mm wide here, and six views are few
REACHED_PX = 0.05


def recorded(folder: Path, board: Board, count: int) -> None:
    """Pairs of the board, and board.toml."""
    (folder / "pictures").mkdir()
    (folder / "board.toml").write_text(board_text(board), encoding="utf-8")
    for i, (tilt, turn, at) in enumerate(POSES[:count]):
        R, t = pose_of(board, tilt, turn, at)
        for state in ("off", "on"):
            image = pictured(board, R, t, np.random.default_rng([i, state == "on"]), state)
            cv2.imwrite(str(folder / "pictures" / f"{i}_{state}.png"), image)


def true_points(uv: np.ndarray) -> np.ndarray:
    """Points (N, 3) of the true laser plane seen at pixels, in the camera's frame, by OpenCV."""
    xy = cv2.undistortPointsIter(uv[:, None], K, LENS, None, None, (3, 50, 1e-12))[:, 0]
    rays = np.column_stack([xy, np.ones(len(xy))])
    return rays * (DISTANCE_MM / (rays @ NORMAL))[:, None]


def apart_mm(found: np.ndarray, truth: np.ndarray) -> float:
    """Root mean square distance of (y, z) from points of a plane, after the best rigid motion."""
    a = np.column_stack([np.zeros(len(found)), found - found.mean(axis=0)])
    b = truth - truth.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return float(np.sqrt(np.mean(np.sum((a - b @ R.T) ** 2, axis=1))))


@pytest.mark.parametrize(
    ("board", "count"),
    [
        pytest.param(BOARDS[1], 4, id="circles, few views"),
        *(pytest.param(b, len(POSES), id=b.kind, marks=pytest.mark.slow) for b in BOARDS),
    ],
)
def test_a_sensor_calibrated_from_pictures_measures_truly(
    tmp_path: Path, board: Board, count: int, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded(tmp_path, board, count)
    arguments = ["calibrate-sensor", str(tmp_path / "pictures"), "--board", str(tmp_path / "board.toml"), "--json"]
    assert run([*arguments, "--out", str(tmp_path / "sensor.toml"), "--terms", "4"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["n_views"] == count
    assert answer["reprojection_rms_px"] < REACHED_PX
    v, u = np.mgrid[100:420:17, 80:560:23]
    uv = np.column_stack([u.ravel(), v.ravel()]).astype(float)
    assert apart_mm(image_to_sheet(read_sensor(tmp_path / "sensor.toml"), uv)[0], true_points(uv)) < REACHED_MM
