"""calibrate-sensor on files: what is found, what is refused, and in which words."""

from __future__ import annotations

import csv
import json
import struct
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.sensor import BoardView, Corners, StripePoints
from extraction.board import BoardCorners, NoBoard, find_board, second_stripe, stripe_on_board
from extraction.board.stripe import as_lit
from extraction.sheet import image_to_sheet
from geometry import Board, Camera, Pose, Sensor, Sheet
from geometry.sensor import DirectMap
from perceptron_emu import EmulatorConfig
from tests.workbench.board_pictures import pictured, pose_of, radius_mm, truth_px
from workbench.cli.main import run
from workbench.emulate import board_solids
from workbench.files import board_text, find_views, read_board, read_sensor, sensor_text
from workbench.sensor import exported
from workbench.sensor.recording import SECOND_SHARE, _never_whole, _together

BOARD = Board("checkerboard", 5, 4, 10.0)
ATOL_PX = 0.02


@lru_cache
def _drawn(tilt: float, shift: float = 0.0, stripe: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """A picture (240, 320) of the board by an exact homography, eight times oversampled, and its corners."""
    h = np.array([[3.6, 0.5 * tilt, 85 + shift], [-0.4, 3.4, 70], [4e-4 * tilt, 1e-3 * tilt, 1.0]])
    v, u = np.mgrid[0:1920, 0:2560]
    p = np.stack([(u + 0.5) / 8 - 0.5, (v + 0.5) / 8 - 0.5, np.ones(u.shape)], -1) @ np.linalg.inv(h).T
    x, y = p[..., 0] / p[..., 2], p[..., 1] / p[..., 2]
    on = (x > -10) & (x < 50) & (y > -10) & (y < 40)
    dark = on & ((np.floor(x / 10) + np.floor(y / 10)) % 2 == 0)
    grey = np.where(dark, 30.0, 170.0)
    if stripe:
        grey = 10 + 180 * np.exp(-0.5 * ((y - 15 - 0.2 * x) / 0.5) ** 2) * np.where(dark, 0.2, 1.0)
    grey = cv2.GaussianBlur(grey, None, 7).reshape(240, 8, 320, 8).mean(axis=(1, 3))
    noisy = grey + np.random.default_rng(0).normal(0, 1.0, grey.shape)
    at = np.column_stack([BOARD.points_mm, np.ones(20)]) @ h.T
    return np.clip(noisy, 0, 255).astype(np.uint8), at[:, :2] / at[:, 2:]


def drawn(tilt: float, shift: float = 0.0, stripe: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """The picture and its corners, to be changed at will."""
    image, corners = _drawn(tilt, shift, stripe)
    return image.copy(), corners


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "board.toml").write_text(board_text(BOARD))
    (tmp_path / "pictures").mkdir()
    return tmp_path


def called(folder: Path, capsys: pytest.CaptureFixture[str], *more: str) -> tuple[int, str, str]:
    arguments = ["calibrate-sensor", str(folder / "pictures"), "--board", str(folder / "board.toml")]
    code = run([*arguments, "--out", str(folder / "sensor.toml"), *more])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_corners_are_found_to_the_pixels_noise() -> None:
    image, corners = drawn(1.0)
    found = find_board(image, BOARD)
    assert not isinstance(found, NoBoard)
    assert len(found) == 20
    nearest = np.linalg.norm(found.uv_px[:, None] - corners, axis=-1).min(axis=1)
    assert nearest.max() < 4 * ATOL_PX
    assert np.sqrt(np.mean(nearest**2)) < 2 * ATOL_PX


def test_a_hidden_part_costs_its_corners_alone() -> None:
    image, corners = drawn(1.0)
    image[:, :118] = 170
    found = find_board(image, BOARD)
    assert not isinstance(found, NoBoard)
    assert 12 <= len(found) < 20
    assert np.linalg.norm(found.uv_px[:, None] - corners, axis=-1).min(axis=1).max() < 5 * ATOL_PX


def test_no_pictures_is_a_sentence(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = called(folder, capsys)
    assert code == 2
    assert "NAME_off.png and NAME_on.png" in err


def test_one_view_is_a_verdict(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cv2.imwrite(str(folder / "pictures" / "a_off.png"), drawn(1.0)[0])
    cv2.imwrite(str(folder / "pictures" / "a_on.png"), drawn(1.0, stripe=True)[0])
    code, out, _ = called(folder, capsys, "--json", "--report", str(folder / "r.html"))
    answer = json.loads(out)
    assert code == 3
    assert answer["verdict"]["code"] == "too_few_views"
    assert not (folder / "sensor.toml").exists()
    assert "caliper" in " ".join(answer["notes"])
    assert "too_few_views" in (folder / "r.html").read_text(encoding="utf-8")


def test_mixed_sizes_name_the_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("a_off", "a_on", "b_off"):
        cv2.imwrite(str(folder / "pictures" / f"{name}.png"), drawn(1.0)[0])
    cv2.imwrite(str(folder / "pictures" / "b_on.png"), drawn(1.0)[0][:200])
    code, _, err = called(folder, capsys)
    assert code == 2
    assert "b_on.png: is 320 × 200 px, most others are 320 × 240 px" in err


def test_a_board_counted_wrongly_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "board.toml").write_text(board_text(Board("checkerboard", 9, 8, 10.0)))
    cv2.imwrite(str(folder / "pictures" / "a_off.png"), drawn(1.0)[0])
    code, out, _ = called(folder, capsys, "--json")
    answer = json.loads(out)
    assert code == 3
    assert answer["views"][0]["reason"] is not None or answer["n_corners"] <= 20


@pytest.mark.parametrize("counts", [(9, 8), (4, 3)])
def test_a_board_counted_wrongly_in_all_pictures_is_a_sentence(
    folder: Path, capsys: pytest.CaptureFixture[str], counts: tuple[int, int]
) -> None:
    (folder / "board.toml").write_text(board_text(Board("checkerboard", *counts, 10.0)))
    for name in "abc":
        cv2.imwrite(str(folder / "pictures" / f"{name}_off.png"), drawn(1.0)[0])
    code, _, err = called(folder, capsys)
    assert code == 2
    assert f"a board of 5 × 4 inner corners where board.toml says {counts[0]} × {counts[1]}" in err


@pytest.mark.parametrize("board", [BOARD, Board("circles", 5, 4, 14.0)])
def test_a_stripe_across_the_print_is_found_without_a_picture_of_the_print_alone(board: Board) -> None:
    rng = np.random.default_rng(5)
    R, t = pose_of(board, (0.3, -0.4), 0.3, (3.0, 2.0, 290.0))
    image = pictured(board, R, t, rng, "both")
    found = find_board(image, board)
    assert isinstance(found, BoardCorners)
    single, pair = (
        stripe_on_board(image, off, board, found).uv_px for off in (None, pictured(board, R, t, rng, "off"))
    )
    print_px = [f(found.uv_px[:, 0]) for f in (np.min, np.max)]
    on_print = [(p[:, 0] > print_px[0]) & (p[:, 0] < print_px[1]) for p in (single, pair)]
    assert on_print[0].sum() > 0.7 * on_print[1].sum() > 20
    off = single[:, 1] - np.polyval(np.polyfit(*pair.T, 2), single[:, 0])
    assert np.sqrt(np.mean(off**2)) < 0.1


def test_other_room_light_in_the_picture_without_laser_costs_no_point() -> None:
    """2.4 times the light: squares would stay on the picture with the stripe. The same light leaves it as it is."""
    board, (image, _) = Board("checkerboard", 5, 4, 10.0), drawn(1.0)
    stripe = drawn(1.0, stripe=True)[0].astype(float) - 10
    corners = find_board(image, board)
    assert isinstance(corners, BoardCorners)
    lit = np.clip(stripe + 0.25 * image, 0, 255).astype(np.uint8)
    same, brighter = ((share * image).astype(np.uint8) for share in (0.25, 0.6))
    everywhere = np.ones(lit.shape, dtype=bool)
    assert as_lit(lit, same, everywhere) is same
    left = as_lit(lit, brighter, everywhere).astype(float) - same
    assert np.sqrt(np.mean(left**2)) < 2.0
    alike, found = (stripe_on_board(lit, off, board, corners) for off in (same, brighter))
    assert len(found) > 0.95 * len(alike)
    apart = np.linalg.norm(found.uv_px[:, None] - alike.uv_px, axis=-1).min(axis=1)
    assert np.median(apart) < 0.05


def test_a_moved_board_is_noticed_by_its_corners(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lit = drawn(1.0, shift=4.0)[0]
    cv2.imwrite(str(folder / "pictures" / "a_off.png"), drawn(1.0)[0])
    cv2.imwrite(str(folder / "pictures" / "a_on.png"), lit)
    _, out, _ = called(folder, capsys, "--json")
    assert "a: the board moved by 3.9 px between laser off and on" in " ".join(json.loads(out)["notes"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('kind = "checkerbord"\n', "checkerbord"),
        ('kind = "checkerboard"\ncorners = [9, 6]\n', "square_mm is missing"),
        ('kind = "circles"\ncorners = [9, 6]\nsquare_mm = 1.0\npitch_mm = 1.0\n', "square_mm is no key"),
        ('kind = "checkerboard"\ncorners = [1, 6]\nsquare_mm = 1.0\n', "1 columns"),
    ],
)
def test_a_wrong_board_file_is_a_sentence(
    folder: Path, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    (folder / "board.toml").write_text(text)
    code, _, err = called(folder, capsys)
    assert code == 2
    assert words in err


def test_views_are_paired_by_name(folder: Path) -> None:
    pictures = folder / "pictures"
    for name in ("a_off", "a_on", "b_off", "c_on", "_d_off"):
        (pictures / f"{name}.png").write_bytes(b"x")
    said: list[str] = []
    views = find_views(pictures, said.append)
    assert [(v.name, v.stripe is not None) for v in views] == [("a", True), ("b", False)]
    assert any("c_on" in s for s in said)


def test_a_board_file_comes_back(folder: Path) -> None:
    board = Board("charuco", 6, 4, 12.0, 9.0, "DICT_4X4_50")
    (folder / "c.toml").write_text(board_text(board))
    assert read_board(folder / "c.toml") == board


def test_the_drawn_squares_cover_the_board_once() -> None:
    bright, dark = board_solids(BOARD, Pose.identity())
    assert dark.mesh.area == pytest.approx(15 * 100)
    assert bright.mesh.area + dark.mesh.area == pytest.approx(80 * 70)


def yaml_like(text: str) -> dict[str, str]:
    """Keys of ROS's camera_info, nested ones joined by a dot."""
    out, above = {}, ""
    for line in text.splitlines():
        key, _, value = line.strip().partition(":")
        if not line.startswith(" "):
            above = key
        out[f"{above}.{key}" if line.startswith(" ") else key] = value.strip()
    return out


def test_exports_hold_the_camera() -> None:
    sensor = read_sensor(Path(__file__).parents[2] / "assets" / "sensors" / "nominal.toml")
    camera = sensor.require_camera()
    plain = json.loads(exported(sensor, "json"))
    normal, distance = np.array(plain["laser_plane_camera"]["normal"]), plain["laser_plane_camera"]["distance_mm"]
    on_sheet = camera.T_sensor_camera.inverse() @ np.array([0.0, 20.0, 300.0])
    assert normal @ on_sheet == pytest.approx(distance, abs=1e-4)
    ros = yaml_like(exported(sensor, "ros"))
    assert (ros["image_width"], ros["image_height"]) == (str(camera.width_px), str(camera.height_px))
    np.testing.assert_allclose(json.loads(ros["camera_matrix.data"]), camera.matrix.ravel(), rtol=0, atol=1e-9)
    assert len(json.loads(ros["distortion_coefficients.data"])) == int(ros["distortion_coefficients.cols"])
    assert len(json.loads(ros["projection_matrix.data"])) == 12
    storage = cv2.FileStorage(exported(sensor, "opencv"), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    np.testing.assert_allclose(storage.getNode("camera_matrix").mat(), camera.matrix, rtol=0, atol=1e-9)


KINDS = (
    Board("circles", 8, 6, 10.0),
    Board("asymmetric_circles", 4, 9, 8.0),
    Board("charuco", 7, 5, 12.0, 8.0, "DICT_4X4_50"),
)


@pytest.mark.parametrize("board", KINDS, ids=lambda b: b.kind)
def test_other_boards_are_found_with_a_stripe_across_them(board: Board) -> None:
    """Steeply tilted, so that a dot's middle is off its image's by more than is allowed here; 0.03 px is its own class.

    The pictures are made by OpenCV's lens and the pattern's own geometry; what the stripe lies on is left out.
    """
    R, t = pose_of(board, (0.5, -0.3), 0.2, (4.0, -3.0, 280.0))
    found = find_board(pictured(board, R, t, np.random.default_rng(1), "both"), board)
    assert not isinstance(found, NoBoard), found.reason
    truth = truth_px(board, R, t)
    nearest = np.linalg.norm(found.uv_px[:, None] - truth, axis=-1).argmin(axis=1)
    error = found.uv_px - truth[nearest]
    assert len(found) > 0.6 * len(truth)
    np.testing.assert_allclose(found.xy_mm, board.points_mm[nearest], atol=1e-9)
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert np.abs(error.mean(axis=0)).max() < 0.01


def test_a_charuco_board_is_found_in_part() -> None:
    board = KINDS[2]
    R, t = pose_of(board, (0.2, 0.3), 0.1, (0.0, 0.0, 280.0))
    image = pictured(board, R, t, np.random.default_rng(2))
    image[:, :300] = 60
    found = find_board(image, board)
    assert not isinstance(found, NoBoard), found.reason
    assert 6 <= len(found) < len(board.points_mm)
    truth = truth_px(board, R, t)[[int(np.argmin(np.linalg.norm(board.points_mm - p, axis=1))) for p in found.xy_mm]]
    assert np.abs(found.uv_px - truth).max() < 0.15


@pytest.mark.parametrize("board", KINDS, ids=lambda b: b.kind)
def test_every_kind_of_board_is_drawn(board: Board) -> None:
    paper, ink = board_solids(board, Pose.identity())
    share = ink.mesh.area / paper.mesh.area
    assert 0.1 < share < 0.6
    if board.kind != "charuco":
        radius = radius_mm(board)
        assert ink.mesh.area == pytest.approx(len(board.points_mm) * np.pi * radius**2, rel=1e-9)


def test_a_board_that_is_never_seen_whole_is_said() -> None:
    """One corner too many each way: found as a part, in every view the same."""
    corners = Corners(BOARD.points_mm, BOARD.points_mm, np.tile(np.eye(2), (20, 1, 1)))
    views = [BoardView(name, corners, StripePoints.nothing()) for name in "ab"]
    assert _never_whole(views, BOARD) == []
    (sentence,) = _never_whole(views, Board("checkerboard", 6, 5, 10.0))
    assert "every view shows 5 × 4 inner corners, board.toml says 6 × 5" in sentence


def test_board_and_stripe_both_flooded_is_a_sentence(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, stripe in (("a_off", False), ("a_on", True)):
        bright = np.maximum(drawn(1.0)[0], drawn(1.0, stripe=stripe)[0]).astype(int) * 2
        cv2.imwrite(str(folder / "pictures" / f"{name}.png"), np.clip(bright, 0, 255).astype(np.uint8))
    code, out, _ = called(folder, capsys, "--json")
    assert code == 3
    assert "a: board and stripe are both saturated, with laser on and off" in " ".join(json.loads(out)["notes"])


def test_a_board_flooded_with_the_laser_off_alone_is_a_sentence(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, gain in (("a_off", 2.0), ("b_off", 1.0)):
        bright = np.clip(gain * drawn(1.0)[0].astype(float), 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / "pictures" / f"{name}.png"), bright)
        cv2.imwrite(str(folder / "pictures" / f"{name[0]}_on.png"), drawn(1.0, stripe=True)[0] // 3)
    cv2.imwrite(str(folder / "pictures" / "c_off.png"), np.full((240, 320), 255, np.uint8))
    cv2.imwrite(str(folder / "pictures" / "c_on.png"), drawn(1.0, stripe=True)[0] // 3)
    code, out, _ = called(folder, capsys, "--json")
    answer = json.loads(out)
    assert code == 3
    said = [n for n in answer["notes"] if "saturated" in n]
    assert len(said) == 1
    assert said[0].startswith("a: the board's white squares are saturated with the laser off")
    assert "100 % of the picture are saturated: expose shorter" in answer["views"][2]["reason"]


def stripe_picture(path: Path) -> None:
    """A straight stripe on black, 640 × 480."""
    v, u = np.mgrid[0:480, 0:640]
    level = 12 + 190 * np.exp(-0.5 * ((v - 200.0 - 0.05 * u) / 2.2) ** 2)
    noisy = level + np.random.default_rng(1).normal(0, 1.0, level.shape)
    cv2.imwrite(str(path), np.clip(noisy, 0, 255).astype(np.uint8))


def direct_sensor(direct: DirectMap | None) -> Sensor:
    towards = np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]])
    camera = Camera(640, 480, 700.0, 700.0, 319.5, 239.5, Pose(towards, np.array([120.0, 0, 300])))
    return Sensor(Sheet(np.zeros(3), 1.0), camera, direct=direct)


MAPS = (
    DirectMap(
        np.array([[0.1, 0.01, -30.0], [-0.02, 0.12, 250.0], [1e-5, 2e-4, 1.0]]), seen_px=(50.0, 0.0, 600.0, 479.0)
    ),
    DirectMap(polynomial=((0, 0, 1.0, 300.0), (1, 0, 40.0, -2.0), (0, 1, 3.0, 30.0), (2, 0, 0.3, 0.4)), rms_mm=0.01),
)


@pytest.mark.parametrize("direct", MAPS, ids=["homography", "polynomial"])
def test_a_direct_map_comes_back_and_measures(
    tmp_path: Path, direct: DirectMap, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "sensor.toml").write_text(sensor_text(direct_sensor(direct), EmulatorConfig()), encoding="utf-8")
    again = read_sensor(tmp_path / "sensor.toml").direct
    assert again is not None
    assert again.polynomial == direct.polynomial
    assert (again.rms_mm, again.seen_px) == (direct.rms_mm, direct.seen_px)
    stripe_picture(tmp_path / "a.png")
    arguments = ["profile", str(tmp_path / "a.png"), "--sensor", str(tmp_path / "sensor.toml")]
    assert run([*arguments, "--csv", str(tmp_path / "a.csv")]) == 0
    capsys.readouterr()
    with (tmp_path / "a.csv").open(encoding="utf-8") as file:
        rows = [r for r in csv.DictReader(line for line in file if not line.startswith("#")) if r["y_mm"]]
    uv, yz = (np.array([[float(r[k]) for k in names] for r in rows]) for names in (("u_px", "v_px"), ("y_mm", "z_mm")))
    assert len(rows) > 400
    np.testing.assert_allclose(yz, direct.to_sheet(uv, (640, 480))[0], rtol=0, atol=1e-3)
    if direct.seen_px is not None:
        assert uv[:, 0].min() >= 50
        assert uv[:, 0].max() <= 600


def test_two_maps_in_one_file_are_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = sensor_text(direct_sensor(MAPS[0]), EmulatorConfig())
    (tmp_path / "sensor.toml").write_text(text + "polynomial = [[0, 0, 1.0, 2.0]]\n", encoding="utf-8")
    stripe_picture(tmp_path / "a.png")
    assert run(["profile", str(tmp_path / "a.png"), "--sensor", str(tmp_path / "sensor.toml"), "--json"]) == 2
    assert "[direct] has homography or polynomial: exactly one of them" in capsys.readouterr().err


def test_exports_measure_as_the_sensor_does() -> None:
    """OpenCV, reading its own file, puts pixels where extraction does."""
    lens = (-0.12, 0.2, 1e-3, -8e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, -0.03)
    sensor = direct_sensor(None).with_camera(distortion=lens)
    T = sensor.require_camera().T_sensor_camera
    uv = np.random.default_rng(0).uniform([150, 150], [500, 350], (20, 2))
    storage = cv2.FileStorage(exported(sensor, "opencv"), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    K, d, plane = (storage.getNode(n).mat() for n in ("camera_matrix", "distortion_coefficients", "laser_plane"))
    ros = yaml_like(exported(sensor, "ros"))
    plain = json.loads(exported(replace(sensor, direct=MAPS[1]), "json"))
    same = [
        (K, d, plane[0, :3], plane[0, 3]),
        (
            np.reshape(json.loads(ros["camera_matrix.data"]), (3, 3)),
            np.array(json.loads(ros["distortion_coefficients.data"])),
            plane[0, :3],
            plane[0, 3],
        ),
        (
            np.array(plain["camera_matrix"]),
            np.array(plain["distortion"]),
            np.array(plain["laser_plane_camera"]["normal"]),
            plain["laser_plane_camera"]["distance_mm"],
        ),
    ]
    expected = image_to_sheet(sensor, uv)[0]
    for matrix, terms, normal, distance in same:
        xy = cv2.undistortPointsIter(uv[:, None], matrix, terms, None, None, (3, 90, 1e-14))[:, 0]
        ray = np.column_stack([xy, np.ones(len(xy))])
        points = T @ (ray * (distance / (ray @ normal))[:, None])
        np.testing.assert_allclose(points[:, 1:], expected, rtol=0, atol=1e-5)
        np.testing.assert_allclose(points[:, 0], 0, rtol=0, atol=1e-5)
    assert DirectMap(polynomial=tuple(map(tuple, plain["direct"]["polynomial"]))).polynomial == MAPS[1].polynomial


def test_a_board_out_of_focus_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, blur in (("a", 4.5), ("b", 0.0)):
        image = drawn(1.0)[0]
        soft = cv2.GaussianBlur(image, None, blur) if blur else image
        cv2.imwrite(str(folder / "pictures" / f"{name}_off.png"), soft)
    _, out, _ = called(folder, capsys, "--json")
    said = [n for n in json.loads(out)["notes"] if "out of focus" in n]
    assert len(said) == 1
    assert said[0].startswith("a: the board is out of focus (edges blurred by 4.")
    assert "the sharpest view's by" in said[0]


def test_what_is_said_of_many_pictures_is_said_once() -> None:
    said = [*(f"{i}.jpg: is a JPEG" for i in range(5)), "a: moved", "b: moved", "no name"]
    assert _together(said) == ["0.jpg and 4 more: is a JPEG", "a: moved", "b: moved", "no name"]


def test_a_second_stripe_is_seen_and_one_alone_is_none() -> None:
    """At a fifth of the first's light, across the board."""
    board = KINDS[0]
    R, t = pose_of(board, (0.3, 0.2), 0.1, (0.0, 0.0, 280.0))
    off, on = (pictured(board, R, t, np.random.default_rng(i), state) for i, state in enumerate(("off", "on")))
    both = np.clip(on + 0.2 * np.roll(on.astype(float), 45, 0), 0, 255).astype(np.uint8)
    corners = find_board(off, board)
    assert isinstance(corners, BoardCorners)
    assert second_stripe(on, off, board, corners, stripe_on_board(on, off, board, corners)) == 0
    assert second_stripe(both, off, board, corners, stripe_on_board(both, off, board, corners)) > SECOND_SHARE


def test_a_mirrored_board_with_markers_is_not_taken() -> None:
    board = KINDS[2]
    R, t = pose_of(board, (0.2, 0.3), 0.1, (0.0, 0.0, 280.0))
    found = find_board(np.ascontiguousarray(pictured(board, R, t, np.random.default_rng(2))[:, ::-1]), board)
    assert isinstance(found, NoBoard)
    assert found.reason.startswith("the picture is mirrored")


def test_pictures_that_are_to_be_turned_are_taken_as_stored(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    exif = b"Exif\0\0II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, 6, 0, 0)
    for state in ("off", "on"):
        plain = cv2.imencode(".jpg", drawn(1.0, stripe=state == "on")[0])[1].tobytes()
        marked = plain[:2] + struct.pack(">HH", 0xFFE1, len(exif) + 2) + exif + plain[2:]
        (folder / "pictures" / f"a_{state}.jpg").write_bytes(marked)
    _, out, _ = called(folder, capsys, "--json")
    answer = json.loads(out)
    assert answer["n_corners"] == 20
    assert any("turn" in n and "stored" in n for n in answer["notes"])
