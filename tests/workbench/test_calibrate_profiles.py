"""`calibrate` on folders as people have them: profiles of a ball or a string jig, joints or a controller's poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calib.synthetic import Noise, made_cell, random_cell
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from geometry import Pose, express
from jig_cad import Jig, Sphere, jig_text
from tests.workbench.helpers import Cli, edit
from workbench.files import read_cell, robot_text
from workbench.profiles import ScanLine, Told, write_scan_lines

DIAMETER_MM = 40.0
NEES_LIMIT = 30.0  # a sound covariance exceeds it in 4 of 100,000 runs


def write_ball(folder: Path, form: str = "gocator", fanuc: bool = False) -> Pose:
    """A ball's dataset with stem and table in its profiles; returns the true SCP."""
    rng = np.random.default_rng(5)
    cell = surface_cell(Sphere(DIAMETER_MM), rng)
    seen = observe_surface(cell, rng, ProfileNoise(), points=150)
    (folder / "profiles").mkdir(parents=True)
    files = {"sensor": '[profile]\nformat = "auto"\n', "target": f'kind = "sphere"\ndiameter_mm = {DIAMETER_MM}\n'}
    files["robot"] = robot_text(cell.robot)
    files["cell"] = 'sensor = "sensor.toml"\ntarget = "target.toml"\nframes = "frames.csv"\n'
    files["cell"] += '[poses]\nconvention = "fanuc"\n' if fanuc else ""
    files["cell"] = files["cell"] if fanuc else files["cell"].replace("frames =", 'robot = "robot.toml"\nframes =')
    for name, text in files.items():
        (folder / f"{name}.toml").write_text(text)
    columns = "X,Y,Z,W,P,R" if fanuc else ",".join(f"j{i}_deg" for i in range(1, 7))
    rows = [f"frame,profile,location,role,{columns}"]
    suffix = {"csv": ".csv", "gocator": ".csv", "ply": ".ply"}[form]
    for f in seen.frames:
        stray = np.column_stack([rng.uniform(-60, 60, 12), rng.uniform(150, 420, 12)])
        far = f.axis.yz_mm[:, 1].max() + 40.0
        table = np.column_stack([np.arange(-50, 50, 1.5), far + rng.normal(size=67) * 0.03])
        yz = np.concatenate([f.axis.yz_mm, stray, table])
        yz = yz[np.argsort(yz[:, 0], kind="stable")]
        write_scan_lines(folder / f"profiles/{f.number:03d}{suffix}", [ScanLine(yz[:, 0], yz[:, 1])], Told(form))
        hand = cell.robot.pose(f.joints_rad)
        numbers = express(hand, "fanuc").values() if fanuc else np.rad2deg(f.joints_rad)
        listed = ",".join(f"{v:.6f}" for v in numbers)
        rows.append(f"{f.number},profiles/{f.number:03d}{suffix},{f.location},{f.role},{listed}")
    (folder / "frames.csv").write_text("\n".join(rows) + "\n")
    return cell.T_hand_sensor


@pytest.mark.parametrize(("form", "fanuc"), [("gocator", False), ("ply", True)])
def test_a_ball_by_a_makers_profiles_without_a_design(cli: Cli, tmp_path: Path, form: str, fanuc: bool) -> None:
    truth = write_ball(tmp_path, form, fanuc)
    outcome = cli("calibrate", tmp_path, *([] if fanuc else ["--model", "full"]), "--json")
    assert outcome.code == 0, outcome.err
    answer = outcome.json
    error = (Pose.from_matrix(np.array(answer["T_hand_sensor"]), 1e-6).inverse() @ truth).log()
    assert error @ np.linalg.solve(np.array(answer["covariance"]), error) < NEES_LIMIT
    place = answer["locations"]["D"]
    assert place["target"]["kind"] == "sphere"
    assert "T_base_jig" not in place
    assert place["n_points"] > place["n_found"] > 8 * 100
    frame = answer["frames"][0]
    assert frame["profile"].startswith("profiles/")
    assert frame["n_points"] > frame["n_found"]
    assert 0 < frame["rms_mm"] < 0.2
    assert "points" not in frame


def test_what_is_wrong_with_profiles_is_said(cli: Cli, tmp_path: Path) -> None:
    write_ball(tmp_path, "csv")
    edit(tmp_path / "sensor.toml", '"auto"\n', '"auto"\nz_towards_sensor = true\n')
    (tmp_path / "profiles" / "003.csv").write_text("y_mm,z_mm\n" + "".join(f"{k / 10},300.0\n" for k in range(300)))
    outcome = cli("calibrate", tmp_path, "--model", "scp", "--json")
    assert outcome.code == 0, outcome.err
    notes = " ".join(outcome.json["notes"])
    assert "z_towards_sensor = false" in notes
    spoilt = next(f for f in outcome.json["frames"] if f["frame"] == 3)
    assert spoilt["reason"] == "no_target"
    assert "arc" in spoilt["complaint"]


def test_a_wrong_pitch_is_told_by_the_balls_ellipses(cli: Cli, tmp_path: Path) -> None:
    write_ball(tmp_path, "csv")
    for path in (tmp_path / "profiles").iterdir():
        rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
        path.write_text("y_mm,z_mm\n" + "".join(f"{float(y) * 0.9:.6f},{z}\n" for y, z in rows))
    outcome = cli("calibrate", tmp_path, "--model", "scp", "--json")
    assert outcome.code in (0, 3), outcome.err
    assert any("check pitch_mm" in note for note in outcome.json["notes"]), outcome.json["notes"]


def test_a_file_that_is_missing_costs_its_frame_alone(cli: Cli, tmp_path: Path) -> None:
    write_ball(tmp_path, "csv")
    (tmp_path / "profiles" / "005.csv").unlink()
    outcome = cli("calibrate", tmp_path, "--model", "scp", "--json")
    assert outcome.code == 0, outcome.err
    lost = next(f for f in outcome.json["frames"] if f["frame"] == 5)
    assert (lost["reason"], lost["used"]) == ("no_profile", False)
    assert "no such" in lost["complaint"]


def test_targets_by_location_and_their_files_errors(cli: Cli, tmp_path: Path) -> None:
    write_ball(tmp_path, "csv")
    edit(tmp_path / "target.toml", "sphere", "spere")
    outcome = cli("calibrate", tmp_path)
    assert outcome.code == 2
    assert 'did you mean "sphere"' in outcome.err
    edit(tmp_path / "target.toml", "spere", "sphere")
    with (tmp_path / "cell.toml").open("a") as stream:
        stream.write('[locations.D]\ntarget = "other.toml"\n')
    assert "other.toml is no file" in cli("calibrate", tmp_path).err
    (tmp_path / "other.toml").write_text('kind = "sphere"\n')
    outcome = cli("calibrate", tmp_path, "--model", "scp", "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.json["locations"]["D"]["target"]["diameter_mm"] == pytest.approx(DIAMETER_MM, abs=0.2)


def string_profile(jig: Jig, T_sensor_jig: Pose, pitch_mm: float, rng: np.random.Generator) -> ScanLine:
    """Each string as a cylinder, cut by the lines y = const of the sheet; a wall behind all of it."""
    y = np.arange(-75.0, 75.0, pitch_mm)
    z = 360.0 + 0.05 * y
    radius = jig.string_diameter_mm / 2
    for start, direction in zip(jig.starts, jig.directions, strict=True):
        s, d = T_sensor_jig @ start, T_sensor_jig.R @ direction
        # |p − s − ((p − s)·d) d|² = r² at p = (0, y, z): a quadratic in z, its near root
        a = np.column_stack([np.full_like(y, -s[0]), y - s[1], np.full_like(y, -s[2])])
        across_a, across_z = a - np.outer(a @ d, d), np.array([0.0, 0.0, 1.0]) - d[2] * d
        qa, qb, qc = across_z @ across_z, across_a @ across_z, np.sum(across_a**2, axis=1) - radius**2
        root = qb**2 - qa * qc
        steep = root < (0.3 * radius) ** 2 * qa  # the flanks send no light back
        near = (-qb - np.sqrt(np.maximum(root, 0))) / qa
        z = np.where(~steep & (near < z), near, z)
    return ScanLine(y, z + rng.normal(size=len(y)) * 0.01)


def test_a_string_jig_by_profiles(cli: Cli, tmp_path: Path) -> None:
    """Three to seven points a string; the answer's error is within its σ."""
    rng = np.random.default_rng(2)
    jig = Jig.nominal(string_diameter_mm=0.4)
    cell = random_cell(rng, jig=jig)
    built = made_cell(cell, rng, Noise())
    (tmp_path / "profiles").mkdir()
    design = cell.design
    files = {"sensor": '[profile]\nformat = "csv"\n', "robot": robot_text(cell.robot), "jig": jig_text(jig)}
    files["cell"] = 'sensor = "sensor.toml"\njig = "jig.toml"\nrobot = "robot.toml"\nframes = "frames.csv"\n'
    files["cell"] += f"[scp_initial]\nrotation_deg = {design.fixed_xyz_deg.tolist()}\n"
    files["cell"] += f"translation_mm = {design.t.tolist()}\n"
    for name, text in files.items():
        (tmp_path / f"{name}.toml").write_text(text)
    rows = ["frame,profile,location,role," + ",".join(f"j{i}_deg" for i in range(1, 7))]
    joints = cell.joints_rad + rng.normal(size=cell.joints_rad.shape) * Noise().joint_rad
    sensors = built.robot.pose(joints) @ built.T_hand_sensor
    for k, name in enumerate(cell.location):
        line = string_profile(built.jig, sensors[k].inverse() @ cell.T_base_jig[name], 0.08, rng)
        write_scan_lines(tmp_path / f"profiles/{k:03d}.csv", [line], Told("csv"))
        readings = ",".join(f"{v:.6f}" for v in np.rad2deg(cell.joints_rad[k]))
        rows.append(f"{k},profiles/{k:03d}.csv,{name},{cell.role[k]},{readings}")
    (tmp_path / "frames.csv").write_text("\n".join(rows) + "\n")
    outcome = cli("calibrate", tmp_path, "--model", "full", "--json")
    assert outcome.code == 0, outcome.err + outcome.out[:600]
    answer = outcome.json
    assert sum(f["used"] for f in answer["frames"]) >= 0.9 * len(answer["frames"])
    error = (Pose.from_matrix(np.array(answer["T_hand_sensor"]), 1e-6).inverse() @ cell.T_hand_sensor).log()
    assert error @ np.linalg.solve(np.array(answer["covariance"]), error) < NEES_LIMIT
    assert np.linalg.norm(error[:3]) < 1.0
    assert answer["locations"]["D"]["point_rms_mm"]["solved"] < 0.12


def test_profiles_beside_a_camera_s_file_are_taken_as_they_are(cli: Cli, tmp_path: Path) -> None:
    """After `init` with a profiler's preset: a camera to emulate with, beside the profiles of the real one."""
    cell = tmp_path / "cell"
    assert cli("init", cell, "--target", "sphere", "--sensor", "lmi_gocator_2340").code == 0
    table = cell / "frames.csv"
    table.write_text(table.read_text() + "0,profiles/0.csv,A,calibrate,1,2,3,4,5,6\n")
    read = read_cell(cell)
    assert read.sensor.camera is None
    assert read.sensor.profile is not None
    assert any("describes a camera" in remark for remark in read.remarks)
    assert read_cell(cell, recorded=False).sensor.camera is not None  # to plan and to emulate with
    table.write_text(table.read_text().replace("profile,", "image,"))
    assert read_cell(cell).sensor.camera is not None


def test_the_starter_names_controllers_poses(cli: Cli, tmp_path: Path) -> None:
    cell = tmp_path / "cell"
    assert cli("init", cell, "--target", "sphere").code == 0
    text = (cell / "cell.toml").read_text().replace("# [poses]", "[poses]").replace("# convention", "convention")
    (cell / "cell.toml").write_text(text.replace("# tool =", "tool ="))
    table = cell / "frames.csv"
    lines = [line for line in table.read_text().splitlines() if line.startswith("#")]
    rows = (
        "frame;profile;location;role;X;Y;Z;W;P;R\r\n0;profiles/0.csv;A;calibrate;812,331;-104,2;640,1;178,3;-3,1;91,5"
    )
    table.write_text("\n".join([*lines, rows]) + "\n")
    (frame,) = read_cell(cell).frames
    assert frame.T_base_hand is not None
    np.testing.assert_allclose(frame.T_base_hand.t, [812.331, -104.2, 640.1], rtol=0, atol=1e-9)
