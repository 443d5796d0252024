"""The Python of docs/sensor.md, run as it is written, beside what its command would have left."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import re
import tomllib
from pathlib import Path

import numpy as np

from geometry import Pose

PAGE = Path(__file__).parents[2] / "docs" / "sensor.md"
ATOL_MM, ATOL_DEG = 0.01, 1e-3  # of six digits of JSON and the page's rounding


def _poses(rng: np.random.Generator, count: int, at_mm: tuple[float, float, float]) -> list[Pose]:
    middle = Pose(np.eye(3), np.array(at_mm))
    return [Pose.exp([*rng.normal(0, 30, 3), *rng.uniform(-0.6, 0.6, 3)]) @ middle for _ in range(count)]


def test_the_hand_eye_of_the_page_is_true(tmp_path: Path) -> None:
    """Views of a board that stands still, by a hand whose sensor is known: [scp_initial] is that sensor's pose."""
    rng = np.random.default_rng(3)
    T_hand_camera = Pose.from_fixed_xyz_deg([20.0, -35.0, 80.0], [60.0, -20.0, 130.0])
    T_sensor_camera = Pose.from_fixed_xyz_deg([-110.0, 0.0, 90.0], [118.0, 0.0, 0.0])
    T_base_board = Pose.from_fixed_xyz_deg([5.0, 170.0, 30.0], [900.0, 100.0, 400.0])
    board = _poses(rng, 6, (0.0, 0.0, 300.0))
    hand = [T_base_board @ b.inverse() @ T_hand_camera.inverse() for b in board]
    views = [{"view": f"v{i}", "used": True, "T_camera_board": b.matrix.tolist()} for i, b in enumerate(board)]
    views.append({"view": "left out", "used": False, "T_camera_board": None})
    answer = {"views": views, "T_sensor_camera": T_sensor_camera.matrix.tolist()}
    (tmp_path / "data.json").write_text(json.dumps(answer), encoding="utf-8")
    with (tmp_path / "poses.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["view", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"])
        table.writerows([f"v{i}", *T.t, *_quaternion(T)] for i, T in enumerate(hand))
    (text,) = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    said, before = io.StringIO(), Path.cwd()
    os.chdir(tmp_path)
    try:
        with contextlib.redirect_stdout(said):
            exec(compile(text, str(PAGE), "exec"), {})  # noqa: S102 - the page's own text
    finally:
        os.chdir(before)
    found = tomllib.loads(said.getvalue())["scp_initial"]
    true = T_hand_camera @ T_sensor_camera.inverse()
    np.testing.assert_allclose(found["translation_mm"], true.t, rtol=0, atol=ATOL_MM)
    np.testing.assert_allclose(found["rotation_deg"], true.fixed_xyz_deg, rtol=0, atol=ATOL_DEG)


def _quaternion(T: Pose) -> list[float]:
    """(w, x, y, z), by scipy."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(T.R).as_quat()
    return [w, x, y, z]
