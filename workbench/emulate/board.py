"""Recordings of a calibration board: pairs of pictures, board lit and stripe on, with truth."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.board import dictionary
from geometry import Board, InputError, Pose, Sensor, exp_so3, field_of_view, rounded
from geometry.sensor import project
from perceptron_emu import EmulatorConfig, Material, Scene, Solid, mean_electrons, render
from workbench.files import board_text, sensor_text, write_png, write_text

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

WHITE, BLACK = Material(diffuse=0.8, roughness=0.3), Material(diffuse=0.06, roughness=0.3)  # matte paper, toner
MARGIN = 1.0  # pitches of white around the squares
LIT_SHARE = 0.55  # of the full well, of the white squares when the board is lit
TILT_DEG = (8.0, 40.0)  # of boards about their own axes: what calibration wants
INSIDE_PX = 12.0  # of every corner from the image's border
INK_MM = -1e-4  # of the ink along the board's z: before the paper, by less than anything sees
# radius of dots over the pitch, which of asymmetric ones is half of a row's step
DOT_SHARE = {"circles": 0.3, "asymmetric_circles": 0.42}
DOT_SIDES = 48  # of the polygons that dots are drawn as, of their area
SAMPLES = 4  # of every pixel along each side: corners then lie within 0.01 px of the printed ones
_TRIES = 400  # poses drawn for one view before the board is said to be too large


@dataclass(frozen=True, eq=False)
class BoardRecording:
    """What a recording was made with: the poses T_sensor_board (V)."""

    sensor: Sensor
    board: Board
    poses: tuple[Pose, ...]


def board_solids(board: Board, T_sensor_board: Pose) -> tuple[Solid, Solid]:
    """The bright and the dark parts of a board as two solids: side by side in one plane, or the ink on the paper.

    Parameters
    ----------
    board
        What is printed. Dots are as wide as boards usually have them; a ChArUco board is OpenCV's.
    T_sensor_board
        Its frame in {P}: origin at the first inner corner, z into the board.

    Returns
    -------
    tuple of Solid
        Bright, dark.

    Raises
    ------
    InputError
        Where a ChArUco board's dictionary is unknown.
    """
    if board.kind != "checkerboard":
        low, high = board.points_mm.min(axis=0), board.points_mm.max(axis=0)
        edge = (1.0 + MARGIN) * board.pitch_mm
        paper = _square(*(low - edge), *(high - low + 2 * edge))
        ink = _markers_and_squares(board) if board.kind == "charuco" else _dots(board)
        return (
            Solid(_together([paper]), WHITE, T_sensor_board, "paper"),
            Solid(_together(ink), BLACK, T_sensor_board, "ink"),
        )
    p = board.pitch_mm
    bright: list[Array] = []
    dark: list[Array] = []
    for row in range(-1, board.rows):
        for column in range(-1, board.columns):
            (dark if (row + column) % 2 == 0 else bright).append(_square(column * p, row * p, p, p))
    low, width, height, m = -p, (board.columns + 1) * p, (board.rows + 1) * p, MARGIN * p
    bright += [_square(low - m, low - m, width + 2 * m, m), _square(low - m, low + height, width + 2 * m, m)]
    bright += [_square(low - m, low, m, height), _square(low + width, low, m, height)]
    return (
        Solid(_together(bright), WHITE, T_sensor_board, "bright squares"),
        Solid(_together(dark), BLACK, T_sensor_board, "dark squares"),
    )


def _square(x: float, y: float, width: float, height: float) -> Array:
    """The corners (4, 3) of a rectangle on the board, around it."""
    return np.array([[x, y, 0], [x + width, y, 0], [x + width, y + height, 0], [x, y + height, 0]], dtype=float)


def _dots(board: Board) -> list[Array]:
    """Polygons of the dots' area, a hair before the paper."""
    turn = 2 * np.pi * np.arange(DOT_SIDES) / DOT_SIDES
    radius = DOT_SHARE[board.kind] * board.pitch_mm
    radius *= np.sqrt(2 * np.pi / DOT_SIDES / np.sin(2 * np.pi / DOT_SIDES))
    rim = radius * np.stack([np.cos(turn), np.sin(turn), np.zeros(DOT_SIDES)], -1)
    return [rim + np.array([x, y, INK_MM]) for x, y in board.points_mm]


def _markers_and_squares(board: Board) -> list[Array]:
    """The dark squares of a ChArUco board and the dark modules of its markers, a hair before the paper."""
    words, p = dictionary(board.dictionary), board.pitch_mm
    printed = cv2.aruco.CharucoBoard((board.columns + 1, board.rows + 1), p, board.marker_mm, words)
    modules = words.markerSize + 2
    side = board.marker_mm / modules
    out, white = [], set()
    for number, corners in zip(np.ravel(printed.getIds()), printed.getObjPoints(), strict=True):
        x, y = np.asarray(corners, dtype=float)[:, :2].min(axis=0)
        white.add((int(y // p), int(x // p)))
        bits = cv2.aruco.generateImageMarker(words, int(number), modules, borderBits=1)
        out += [_square(x - p + j * side, y - p + i * side, side, side) for i, j in np.argwhere(bits == 0)]
    places = ((i, j) for i in range(board.rows + 1) for j in range(board.columns + 1))
    out += [_square((j - 1) * p, (i - 1) * p, p, p) for i, j in places if (i, j) not in white]
    return [polygon + np.array([0, 0, INK_MM]) for polygon in out]


def _together(polygons: list[Array]) -> trimesh.Trimesh:
    """One mesh of convex polygons of equally many corners, each a fan of triangles."""
    import trimesh  # a quarter of a second, and most commands build no mesh

    sides = len(polygons[0])
    first = sides * np.arange(len(polygons))[:, None, None]
    fan = np.array([[0, k, k + 1] for k in range(1, sides - 1)])
    return trimesh.Trimesh(np.concatenate(polygons), (first + fan).reshape(-1, 3), process=False)


def planned_boards(sensor: Sensor, board: Board, count: int, rng: np.random.Generator) -> tuple[Pose, ...]:
    """Poses T_sensor_board of boards that the camera sees whole and the sheet crosses, tilted to all sides.

    InputError where the board does not fit into the image.
    """
    camera = sensor.require_camera()
    polygon = field_of_view(sensor, margin_px=INSIDE_PX)
    out: list[Pose] = []
    for _ in range(_TRIES * count):
        if len(out) == count:
            break
        weights = rng.dirichlet(np.ones(len(polygon)))
        place = np.array([0.0, *(weights @ polygon)])
        T = _facing(sensor, board, place, rng)
        corners = project(camera, T @ _with_zero(board.points_mm))
        size = np.array([camera.width_px, camera.height_px])
        if np.all((corners > INSIDE_PX) & (corners < size - INSIDE_PX)):
            out.append(T)
    if len(out) < count:
        raise InputError(
            f"a board of {board.columns} × {board.rows} corners, {board.pitch_mm:g} mm apart, does not fit into the "
            "camera's image: take a smaller one"
        )
    return tuple(out)


def _facing(sensor: Sensor, board: Board, place: Array, rng: np.random.Generator) -> Pose:
    """A board about ``place`` that faces the camera but for its tilt, turned in its plane at random."""
    camera = sensor.require_camera()
    view = place - camera.centre_mm
    z = view / np.linalg.norm(view)
    x = np.cross(camera.T_sensor_camera.R[:, 1], z)
    x = x / np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(z, x), z])
    tilt, way = np.deg2rad(rng.uniform(*TILT_DEG)), rng.uniform(0, 2 * np.pi)
    tilted = frame @ exp_so3(tilt * np.array([np.cos(way), np.sin(way), 0.0]))
    R = tilted @ exp_so3(np.array([0, 0, rng.uniform(-3, 3)]))
    # the sheet crosses the board off its middle
    middle = _with_zero(board.points_mm).mean(axis=0) + np.array([*rng.uniform(-1, 1, 2) * board.pitch_mm, 0.0])
    return Pose(R, place - R @ middle)


def _with_zero(xy: Array) -> Array:
    return np.column_stack([xy, np.zeros(len(xy))])


def record_boards(
    out: Path,
    sensor: Sensor,
    emulator: EmulatorConfig,
    board: Board,
    count: int,
    seed: int,
    progress: Callable[[int, int], None],
) -> BoardRecording:
    """Write NAME_off.png (board lit, laser off) and NAME_on.png (stripe, room dark) of every view, with truth.

    Parameters
    ----------
    out
        Folder for images/, board.toml and truth.json with the true sensor.toml's text.
    sensor, emulator
        The sensor and how it is emulated.
    board
        What is recorded.
    count
        Number of views.
    seed
        Same seed, same bytes.
    progress
        Told how many of how many views are done.

    Returns
    -------
    BoardRecording
        What was recorded.

    """
    poses = planned_boards(sensor, board, count, np.random.default_rng([seed, 2**31]))
    for i, T in enumerate(poses):
        scene = Scene(sensor, solids=board_solids(board, T))
        dark = emulator.off("ambient")
        lit = _lit(scene, emulator)
        for end, config, key in (("off", lit, 0), ("on", dark, 1)):
            frame = render(scene, config, np.random.default_rng([seed, i, key]))
            write_png(out / "images" / f"{i:03d}_{end}.png", frame.image)
        progress(i + 1, count)
    write_text(out / "board.toml", board_text(board))
    truth = {"T_sensor_board": [T.matrix.tolist() for T in poses], "sensor_toml": sensor_text(sensor, emulator)}
    write_text(out / "truth.json", json.dumps(rounded(truth), indent=1, allow_nan=False) + "\n")
    return BoardRecording(sensor, board, poses)


def _lit(scene: Scene, emulator: EmulatorConfig) -> EmulatorConfig:
    """The laser off and the room as bright as the board's white asks for."""
    exposure = emulator.exposure.model_copy(update={"laser_on": False})
    ambient = emulator.ambient.model_copy(update={"enabled": True, "fill": 1.0, "samples": SAMPLES})
    config = emulator.model_copy(update={"exposure": exposure, "ambient": ambient})
    brightest = float(np.percentile(mean_electrons(scene, config), 99.5))
    gain = LIT_SHARE * emulator.noise.full_well_e / max(brightest, 1e-6)
    ambient = ambient.model_copy(update={"irradiance_mw_m2_nm": ambient.irradiance_mw_m2_nm * gain})
    return config.model_copy(update={"ambient": ambient})
