"""A sensor's calibration: beside OpenCV's on pictures, and against truth on emulated sensors.

    python benchmarks/calibrate_sensor.py FOLDER board.toml
    python benchmarks/calibrate_sensor.py FOLDER board.toml --published profile3d.yaml
    python benchmarks/calibrate_sensor.py --emulated FOLDER…
    python benchmarks/calibrate_sensor.py --sensors 200 [--tilt 1 10] [--seed 0] [--kept FILE.jsonl]

The first form prints left-out views of ours and of cv2.calibrateCamera with a plane fitted afterwards, on the same
pictures: the peer with our stripes, and with a plain centre of mass of its own (columns, or rows, within the board's
corners). Left out: the camera and the plane from the other views, the left-out board's pose from its corners alone.

The third takes folders of `perceptron-emu render --board` and prints what their calibration is off by: the mapping from
pixels to (y, z) after the best rigid motion, and squared errors of all stated parameters over their covariance.

The last draws sensors (every other one with its chip tilted), views of them as points by geometry's lens (which is
OpenCV's to rounding) with noise of 0.03 px, and prints

NEES        squared errors of all stated parameters over their covariance, a parameter: 1 where it is true. What chance
            makes of it is told by draws from what is stated: far out along a bent valley squared errors scatter more
            than those of one ellipsoid
coverage    how often |error| < 1.96 sigma, of every parameter
tilt        how often the chip's tilt was taken; shape: how often the flat board's
mapping     pixel to (y, z) where stripes were seen, after the best rigid motion within the sheet: root mean square
            error over its bound by the points' own sigma and the true set of terms, and over the stated sigma; with
            what chance makes of the first: one direction holds two thirds of the mapping's variance, so that a sensor
            is worth no more than two independent numbers
left out    root mean square of left-out views over that of the true set of terms
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from calib.sensor import BoardView, SensorCalibration, SensorSolution, calibrate_sensor
from calib.sensor.bundle import SensorBundle
from calib.sensor.shape import BENDS, PRINT
from calib.sensor.sheet_frame import camera_rows, sheet_deviations, sheet_frame, to_sheet
from calib.sensor.stated import Answer, parts_by_name
from calib.sensor.terms import BOARD, CAMERA, PLANE
from calib.sensor.valley import settled
from calib.sensor.views import BoardViews
from calib.synthetic.boards import SIZE_PX, SyntheticSensor, observe_boards, parameter_errors, synthetic_sensor
from geometry import Board, Sensor, State
from workbench.files import ViewFiles, find_views, read_board, read_image, read_sensor
from workbench.sensor import calibrate_recording, read_recording

Array = NDArray[np.float64]

CENTRE = (np.array(SIZE_PX) - 1) / 2
EVERY = 5  # of the stripes' pixels, where the mapping is compared
COVERED = 1.96  # sigma that hold 95 %
DRAWS = 4000  # of what a sensor's file states
COM_SHARE, COM_REACH_PX = 0.5, 12  # of the brightest level, and about it: what counts in a plain centre of mass


@dataclass(frozen=True, eq=False)
class Trial:
    """What one sensor gave.

    variance: of nees, and beyond: how likely a larger one is, both by draws from what is stated.
    mapping: mean squares of error, bound and stated variance [mm2], and how many independent numbers it is worth.
    """

    tilt_deg: float
    terms: tuple[str, ...]
    nees: float
    pulls: dict[str, float]
    mapping: tuple[float, float, float, float]
    left_out: tuple[float, float]
    verdict: str
    variance: float = np.nan
    beyond: float = np.nan
    shape: tuple[str, ...] = ()


def trial(seed: int, index: int, tilt_deg: float) -> Trial:
    """A sensor drawn, observed and calibrated."""
    rng = np.random.default_rng([seed, index])
    sensor = synthetic_sensor(rng, tilt_deg)
    views = observe_boards(sensor, rng)
    found = calibrate_sensor(views, SIZE_PX)
    if found.solution is None:
        return Trial(tilt_deg, (), np.nan, {}, (np.nan,) * 4, (np.nan,) * 2, found.verdict.code)
    s = found.solution
    error, covariance = parameter_errors(s, sensor), s.uncertainty.covariance
    pulls = error / np.sqrt(np.diag(covariance))
    nees = float(error @ np.linalg.solve(covariance, error))
    drawn = drawn_nees(found, np.random.default_rng([seed, index, 1]))
    return Trial(
        tilt_deg,
        s.terms,
        nees,
        dict(zip(s.uncertainty.parameters, pulls.tolist(), strict=True)),
        mapping(found, sensor, views),
        left_out_ratio(found, sensor),
        found.verdict.code,
        float(np.var(drawn)),
        float(np.mean(drawn > nees)),
        shape_terms(found),
    )


def shape_terms(found: SensorCalibration) -> tuple[str, ...]:
    """Which of the board's shape were taken."""
    shape = found.shape
    if shape is None:
        return ()
    return (*(() if shape.bend_per_mm is None else BENDS), *((PRINT,) if len(shape.offset_mm) else ()))


def drawn_nees(found: SensorCalibration, rng: np.random.Generator) -> Array:
    """Squared errors over the stated covariance (DRAWS,) of sensors drawn from what is stated."""
    s, tilts = found.solution, found.tilts
    assert s is not None
    covariance = s.uncertainty.covariance
    if tilts is None:
        return rng.chisquare(len(covariance), DRAWS)
    camera = np.concatenate([s.camera[:2], s.camera[2:4] - CENTRE, s.camera[4:]])
    answer = Answer(camera, plane_vector(s), s.frame, SIZE_PX)
    off, own = parts_by_name(answer, tuple(s.uncertainty.parameters[4:-3]), tilts)
    out = []
    for k, count in enumerate(rng.multinomial(DRAWS, tilts.weight)):
        values, vectors = np.linalg.eigh(own[k])
        one = rng.standard_normal((count, len(values))) * np.sqrt(np.maximum(values, 0.0))
        drawn = off[k] + one @ vectors.T
        out.append(np.sum(np.linalg.solve(covariance, drawn.T).T * drawn, axis=1))
    return np.concatenate(out)


def left_out_ratio(found: SensorCalibration, sensor: SyntheticSensor) -> tuple[float, float]:
    """Root mean squares of left-out corners and stripes with the chosen terms over those with the true ones."""
    assert found.solution is not None
    by_terms = {t.terms: t for t in found.tried}
    shape = shape_terms(found)
    mine, true = by_terms[(*found.solution.terms, *shape)], by_terms[(*sensor.terms, *shape)]
    return mine.reprojection_rms_px / true.reprojection_rms_px, mine.plane_rms_mm / true.plane_rms_mm


def mapping(
    found: SensorCalibration, sensor: SyntheticSensor, views: Sequence[BoardView]
) -> tuple[float, float, float, float]:
    """Mean squares [mm2] of the mapping's error, its bound and its stated variance, free of rigid motions; freedom."""
    s = found.solution
    assert s is not None
    uv = np.concatenate([v.stripe.uv_px for v in views])[::EVERY] - CENTRE
    true_camera, camera = (np.concatenate([c[:2], c[2:4] - CENTRE, c[4:]]) for c in (sensor.camera, s.camera))
    true_plane, plane = sensor.normal / sensor.distance_mm, s.plane_normal / s.plane_mm
    yz = to_sheet(true_camera, sheet_frame(true_camera, true_plane), uv)
    rigid = _without_motion(yz)
    error = rigid(to_sheet(camera, sheet_frame(camera, plane), uv).reshape(-1) - yz.reshape(-1))
    bundle = SensorBundle(BoardViews.of([_centred(v) for v in views]), sensor.terms, float(SIZE_PX[0]))
    if len(found.views) == found.n_views:
        start = State({CAMERA: true_camera, BOARD: s.boards, PLANE: true_plane})
        result = settled(bundle, start)
        bound = bundle.covariance(result)
        u = result.unknowns
        columns = np.concatenate([u.indices(CAMERA)[list(camera_rows(sensor.terms))], u.indices(PLANE)])
        # both where the fit is: the mapping stays along the bent valley, not along a tangent that was drawn elsewhere
        fitted = result.state.vector(CAMERA), result.state.vector(PLANE)
        by = rigid(_by_parameters(*fitted, camera_rows(sensor.terms), uv))
        covariance = bound[np.ix_(columns, columns)]
        bound_square = float(np.sum((by @ covariance) * by)) / len(uv)
        power = by.T @ by @ covariance
        freedom = float(np.trace(power) ** 2 / np.trace(power @ power))
    else:
        bound_square = freedom = np.nan
    terms = tuple(s.uncertainty.parameters[4:-3])  # those considered, too
    stated = _stated(s.uncertainty.of_points, terms, camera, plane, uv)
    stated_square = float(np.sum((stated[0] @ stated[1]) * stated[0])) / len(uv)
    return float(error @ error) / len(uv), bound_square, stated_square, freedom


def _stated(covariance: Array, terms: tuple[str, ...], camera: Array, plane: Array, uv: Array) -> tuple[Array, Array]:
    """The mapping by the stated parameters, free of rigid motions, and their covariance."""
    rows = camera_rows(terms)
    by = _by_parameters(camera, plane, rows, uv)
    turned = np.linalg.inv(sheet_deviations(sheet_frame(camera, plane), plane))
    by = np.column_stack([by[:, : len(rows)], by[:, len(rows) :] @ turned])
    yz = to_sheet(camera, sheet_frame(camera, plane), uv)
    return _without_motion(yz)(by), covariance


def _without_motion(yz: Array) -> Callable[[Array], Array]:
    """What takes shifts and the turn within the sheet off values (2N, ...) of points (N, 2)."""
    one, zero = np.ones(len(yz)), np.zeros(len(yz))
    motions = np.stack([np.stack(m, -1).reshape(-1) for m in ((one, zero), (zero, one), (-yz[:, 1], yz[:, 0]))], -1)
    q = np.linalg.qr(motions)[0]
    return lambda values: values - q @ (q.T @ values)


def _by_parameters(camera: Array, plane: Array, rows: tuple[int, ...], uv: Array) -> Array:
    """Derivatives (2N, P) of (y, z) by the camera's numbers and the plane's vector, by central differences."""
    columns = []
    for i in (*rows, 18, 19, 20):
        ends = []
        for sign in (1.0, -1.0):
            c, p = camera.copy(), plane.copy()
            step = (1e-3 if i < 4 else 1e-6) if i < 18 else 1e-6 * np.linalg.norm(plane)
            (c if i < 18 else p)[i if i < 18 else i - 18] += sign * step
            ends.append(to_sheet(c, sheet_frame(c, p), uv).reshape(-1))
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, -1)


def _centred(view: BoardView) -> BoardView:
    return replace(
        view,
        corners=replace(view.corners, uv_px=view.corners.uv_px - CENTRE),
        stripe=replace(view.stripe, uv_px=view.stripe.uv_px - CENTRE),
    )


def kept_trials(count: int, tilts: tuple[float, float], seed: int, kept: Path | None) -> list[Trial]:
    """The trials, those of an earlier run out of the file ``kept``."""
    rng = np.random.default_rng(seed)
    drawn = [float(rng.uniform(*tilts)) if i % 2 else 0.0 for i in range(count)]
    lines = kept.read_text().splitlines() if kept is not None and kept.exists() else []
    trials = [Trial(**json.loads(line)) for line in lines[:count]]
    for i in range(len(trials), count):
        trials.append(trial(seed, i, drawn[i]))
        if kept is not None:
            with kept.open("a") as file:
                file.write(json.dumps(asdict(trials[-1])) + "\n")
    return trials


def consistency(trials: Sequence[Trial]) -> None:
    """Print the figures of sensors, every other of which has its chip tilted."""
    for name, group in (("upright", trials[::2]), ("tilted", trials[1::2]), ("all", trials)):
        good = [t for t in group if t.terms]
        numbers = sum(len(t.pulls) for t in good)
        total = sum(t.nees for t in good)
        spread = float(np.sqrt(sum(t.variance for t in good))) / numbers
        low, high = 1 - COVERED * spread, 1 + COVERED * spread
        print(f"{name}: {len(good)} of {len(group)} sensors")
        print(f"  NEES a parameter {total / numbers:.3f} (95 % of chance: {low:.3f} to {high:.3f})")
        worst = [t for t in good if t.beyond < 1e-3]
        print(f"  sensors beyond one in a thousand: {len(worst)}")
        print(f"  a board's shape taken: {np.mean([bool(t.shape) for t in good]):.3f}")
        print(f"  tilt taken: {np.mean(['tau_x' in t.terms for t in good]):.3f}")
        names = dict.fromkeys(n for t in good for n in t.pulls)
        held = {n: np.mean([abs(t.pulls[n]) < COVERED for t in good if n in t.pulls]) for n in names}
        print("  coverage: " + ", ".join(f"{n} {100 * v:.0f}" for n, v in held.items()))
        square = np.array([t.mapping for t in good])
        square = square[np.isfinite(square).all(axis=1)]
        rms = np.sqrt(square[:, :3].mean(axis=0))
        spread = np.sqrt(np.sum(2 * square[:, 1] ** 2 / square[:, 3])) / square[:, 1].sum()  # of the squared ratio
        low, high = np.sqrt(np.maximum(1 + np.array([-COVERED, COVERED]) * spread, 0))
        print(
            f"  mapping: {1e3 * rms[0]:.2f} um, {rms[0] / rms[1]:.3f} of the bound (95 % of chance: {low:.2f} to "
            f"{high:.2f}), {rms[0] / rms[2]:.3f} of the stated ({len(square)} sensors)"
        )
        ratio = np.array([t.left_out for t in good])
        print(
            f"  left out over the true terms': mean {ratio.mean(axis=0).round(4)}, worst {ratio.max(axis=0).round(3)}"
        )
        codes = [t.verdict for t in group]
        print("  verdicts: " + ", ".join(f"{c} {codes.count(c)}" for c in dict.fromkeys(codes)))


def peer_corners(files: ViewFiles, board: Board, sensor: Sensor) -> Array | None:
    """OpenCV's corners (N, 2) of a view, refined by cornerSubPix."""
    image = read_image(files.board, sensor, lossy=True)
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


def centre_of_mass(files: ViewFiles, sensor: Sensor, corners: Array) -> Array:
    """A plain stripe (M, 2), within the hull of the board's corners.

    Of every column, or row where the stripe runs down, the centre of the levels about its brightest; the picture
    without laser is taken off where the room is lit in both.
    """
    assert files.stripe is not None
    off, on = (read_image(p, sensor, lossy=True).astype(float) for p in (files.board, files.stripe))
    hull = np.zeros(on.shape, np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(np.round(corners).astype(np.int32)), 1)
    inside = hull > 0
    lit = files.stripe != files.board and np.median(on[inside]) > np.median(off[inside]) / 2
    light = np.where(inside, np.maximum(on - off if lit else on, 0.0), 0.0)
    v, u = np.nonzero(light > COM_SHARE * light.max())
    down = np.ptp(v) > np.ptp(u)
    light = light.T if down else light
    top = light.max(axis=0)
    near = np.abs(np.arange(len(light))[:, None] - light.argmax(axis=0)) <= COM_REACH_PX
    light = np.where(near & (light > COM_SHARE * top) & (top > COM_SHARE * light.max()), light, 0.0)
    mass = light.sum(axis=0)
    seen = np.flatnonzero(mass)
    across = (np.arange(len(light)) @ light)[seen] / mass[seen]
    return np.column_stack([across, seen] if down else [seen, across])


def peer(corners: list[Array], stripes: list[Array], board: Board, size: tuple[int, int]) -> tuple[float, float]:
    """Reprojection [px] over all views, and left-out distances of the stripes from the plane [mm]."""
    xyz = np.column_stack([board.points_mm, np.zeros(len(board.points_mm))]).astype(np.float32)
    usual = [c.astype(np.float32) for c in corners]
    rms = cv2.calibrateCamera([xyz] * len(usual), usual, size, None, None)[0]
    off = []
    for k, stripe in enumerate(stripes):
        rest = [i for i in range(len(usual)) if i != k]
        _, K, d, rs, ts = cv2.calibrateCamera([xyz] * len(rest), [usual[i] for i in rest], size, None, None)
        seen = [on_board(K, d, r, t, stripes[i]) for i, r, t in zip(rest, rs, ts, strict=True)]
        middle, normal = plane_of(np.concatenate(seen))
        _, r, t = cv2.solvePnP(xyz, usual[k], K, d)
        off.append((on_board(K, d, r, t, stripe) - middle) @ normal)
    return float(rms), float(np.sqrt(np.mean(np.concatenate(off) ** 2)))


def beside_peers(folder: Path, board_file: Path) -> None:
    """Print ours and the peer on the same pictures."""
    board, files = read_board(board_file), find_views(folder)
    recording = read_recording(files, board)
    result = calibrate_recording(recording)
    print(
        f"ours: {result.reprojection_rms_px:.4f} px, left-out plane {result.left_out_mm:.4f} mm, {result.verdict.code}"
    )
    by_name = {v.name: v for v in recording.views}
    both = [(f, peer_corners(f, board, recording.sensor), by_name[f.name]) for f in files if f.name in by_name]
    good = [(f, c, v) for f, c, v in both if c is not None and len(v.stripe)]
    camera = recording.sensor.require_camera()
    corners = [c for _, c, _ in good]
    stripes = {
        "our stripes": [v.stripe.uv_px for _, _, v in good],
        "a plain centre of mass": [centre_of_mass(f, recording.sensor, c) for f, c, _ in good],
    }
    for name, points in stripes.items():
        rms, off = peer(corners, points, board, (camera.width_px, camera.height_px))
        print(f"OpenCV, {name}, a plane afterwards ({len(good)} views): {rms:.4f} px, left-out plane {off:.4f} mm")


def beside_published(folder: Path, board_file: Path, published: Path) -> None:
    """Print how far a published map of pixels to the laser plane in the camera's frame lies from ours.

    published: a YAML file of openlmd/etna, whose 4 × 3 ``trans`` takes (u, v, 1) to homogeneous points [m].
    """
    import yaml

    matrix = np.array(yaml.safe_load(published.read_text())["trans"])
    recording = read_recording(find_views(folder), read_board(board_file))
    for terms in (8, 14):
        result = calibrate_recording(recording, terms)
        s = result.solution
        if s is None:
            print(f"{terms} terms: {result.verdict.code}")
            continue
        uv = np.concatenate([v.stripe_px for v in result.views if v.stripe_px is not None])[::EVERY]
        h = np.column_stack([uv, np.ones(len(uv))]) @ matrix.T
        theirs = 1e3 * h[:, :3] / h[:, 3:]
        middle, normal = plane_of(theirs)
        normal = normal * np.sign(normal @ middle)
        _, y, z = s.frame.T_sensor_camera.R
        off = [np.rad2deg(z @ normal), np.rad2deg(-y @ normal), float(s.plane_normal @ middle) - s.plane_mm]
        sigma = s.uncertainty.sigma
        known = [np.rad2deg(sigma["plane_tilt_y_rad"]), np.rad2deg(sigma["plane_tilt_z_rad"]), sigma["plane_shift_mm"]]
        turn = np.rad2deg(np.arccos(np.clip(normal @ s.plane_normal, -1, 1)))
        print(
            f"{terms} terms at most, {', '.join(s.terms)}: {result.reprojection_rms_px:.3f} px, plane "
            f"{result.plane_rms_mm:.3f} mm, left out {result.left_out_mm:.3f} mm; "
            f"published plane turned by {turn:.2f} deg: "
            + ", ".join(
                f"{n} {o:.2f} +- {k:.2f} {u}"
                for n, o, k, u in zip(
                    ("about y", "about z", "at the stripes' middle"), off, known, ("deg", "deg", "mm"), strict=True
                )
            )
        )
        camera = np.concatenate([s.camera[:2], s.camera[2:4] - CENTRE, s.camera[4:]])
        yz = to_sheet(camera, s.frame, uv - CENTRE)
        own = s.frame.T_sensor_camera.inverse() @ np.column_stack([np.zeros(len(yz)), yz])
        a, b = own - own.mean(axis=0), theirs - middle
        u, _, vt = np.linalg.svd(a.T @ b)
        R = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
        rest = b @ R.T - a
        print(f"    mapping after the best rigid motion: {np.sqrt(np.mean(np.sum(rest**2, axis=1))):.3f} mm apart")
        jacobian, covariance = _stated(
            s.uncertainty.of_points, tuple(s.uncertainty.parameters[4:-3]), camera, plane_vector(s), uv - CENTRE
        )
        print(f"    stated for ours: {np.sqrt(float(np.sum((jacobian @ covariance) * jacobian)) / len(uv)):.3f} mm")


def beside_truth(folders: Sequence[Path]) -> None:
    """What calibrations of our own emulator's recordings are off by."""
    total, numbers = 0.0, 0
    for folder in folders:
        with TemporaryDirectory() as place:
            (Path(place) / "sensor.toml").write_text(json.loads((folder / "truth.json").read_text())["sensor_toml"])
            true = read_sensor(Path(place) / "sensor.toml").require_camera()
        camera = np.array([true.fx_px, true.fy_px, true.cx_px, true.cy_px, *true.distortion14])
        normal, distance = -true.T_sensor_camera.R[0], float(true.T_sensor_camera.t[0])
        recording = read_recording(find_views(folder / "images", lambda said: None), read_board(folder / "board.toml"))
        found = calibrate_recording(recording)
        s = found.solution
        assert s is not None
        error = parameter_errors(s, SyntheticSensor(camera, normal, distance))
        nees = float(error @ np.linalg.solve(s.uncertainty.covariance, error))
        total, numbers = total + nees, numbers + len(error)
        middle = (np.array([true.width_px, true.height_px]) - 1) / 2
        uv = np.concatenate([v.stripe.uv_px for v in recording.views])[::EVERY] - middle
        yz = []
        for c, p in ((camera, normal / distance), (s.camera, plane_vector(s))):
            centred = np.concatenate([c[:2], c[2:4] - middle, c[4:]])
            yz.append(to_sheet(centred, sheet_frame(centred, p), uv))
        apart = _without_motion(yz[0])((yz[1] - yz[0]).reshape(-1))
        print(
            f"{folder}: {found.n_views} views, mapping off by {1e3 * np.sqrt(apart @ apart / len(uv)):.2f} µm, squared "
            f"errors {nees:.1f} of {len(error)}, corners {found.corner_scale:.2f} and stripes {found.stripe_scale:.2f} "
            "of their stated σ"
        )
    low, high = chi2.ppf([0.025, 0.975], numbers) / numbers
    print(f"all: squared errors a parameter {total / numbers:.2f} (95 % of chance: {low:.2f} to {high:.2f})")


def plane_vector(solution: SensorSolution) -> Array:
    """The plane p · X = 1 of a solution."""
    return solution.plane_normal / solution.plane_mm


def main() -> None:
    """As the module's text says."""
    parser = argparse.ArgumentParser()
    parser.add_argument("pictures", nargs="*", type=Path, metavar="FOLDER board.toml")
    parser.add_argument("--published", type=Path, help="profile3d.yaml of others, to compare the laser plane with")
    parser.add_argument("--emulated", type=Path, nargs="+", help="folders of render --board")
    parser.add_argument("--sensors", type=int, default=0)
    parser.add_argument("--tilt", type=float, nargs=2, default=(1.0, 10.0))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kept", type=Path, help="file that trials are kept in, to go on from")
    asked = parser.parse_args()
    if asked.sensors:
        consistency(kept_trials(asked.sensors, tuple(asked.tilt), asked.seed, asked.kept))
    if asked.emulated:
        beside_truth(asked.emulated)
    if len(asked.pictures) == 2 and asked.published is not None:
        beside_published(*asked.pictures, published=asked.published)
    elif len(asked.pictures) == 2:
        beside_peers(*asked.pictures)


if __name__ == "__main__":
    main()
