"""What people get wrong with profiles, each through the command: a sentence or a verdict, never a false SCP."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from calib.synthetic.cell import DESIGN
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from jig_cad import Plane, Sphere
from tests.workbench.helpers import Cli, edit
from workbench.cli.main import run
from workbench.files import robot_text
from workbench.profiles import ScanLine, Told, write_scan_lines

Array = np.ndarray
CALIBRATE = (("A", "calibrate", 8), ("B", "calibrate", 8))


def _dataset(folder: Path, target: Sphere | Plane, text: str, bend_mm: float = 0.0) -> None:
    rng = np.random.default_rng(3)
    cell = surface_cell(target, rng, CALIBRATE)  # type: ignore[arg-type]
    seen = observe_surface(cell, rng, ProfileNoise(), points=80)
    (folder / "profiles").mkdir(parents=True)
    angles, lengths = (", ".join(f"{v:.6f}" for v in values) for values in (DESIGN.fixed_xyz_deg, DESIGN.t))
    (folder / "sensor.toml").write_text('[profile]\nformat = "auto"\n')
    (folder / "target.toml").write_text(text)
    (folder / "robot.toml").write_text(robot_text(cell.robot))
    (folder / "cell.toml").write_text(
        'sensor = "sensor.toml"\ntarget = "target.toml"\nrobot = "robot.toml"\nframes = "frames.csv"\n'
        f"[scp_initial]\nrotation_deg = [{angles}]\ntranslation_mm = [{lengths}]\n"
    )
    rows = ["frame,profile,location,role," + ",".join(f"j{i}_deg" for i in range(1, 7))]
    for f in seen.frames:
        yz = f.axis.yz_mm[np.argsort(f.axis.yz_mm[:, 0], kind="stable")].copy()
        t = np.linspace(-1, 1, len(yz))
        yz[:, 1] += bend_mm * (1 - t**2)
        name = f"profiles/{f.number:03d}.csv"
        write_scan_lines(folder / name, [ScanLine(yz[:, 0], yz[:, 1])], Told("csv"))
        assert f.joints_rad is not None
        rows.append(
            f"{f.number},{name},{f.location},{f.role}," + ",".join(f"{v:.6f}" for v in np.rad2deg(f.joints_rad))
        )
    (folder / "frames.csv").write_text("\n".join(rows) + "\n")


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ball") / "ball"
    _dataset(folder, Sphere(40.0), 'kind = "sphere"\ndiameter_mm = 40\n')
    return folder


def _each(folder: Path, change: Callable[[Array], str]) -> None:
    for path in sorted((folder / "profiles").iterdir()):
        path.write_text(change(np.loadtxt(path, delimiter=",", skiprows=1)))


def _text(yz: Array) -> str:
    return "y_mm,z_mm\n" + "".join(f"{y:.6f},{z:.6f}\n" for y, z in yz)


def _with_commas(separator: str) -> Callable[[Array], str]:
    return lambda yz: (
        f"y_mm{separator}z_mm\n" + "".join(f"{y:.6f}{separator}{z:.6f}\n".replace(".", ",") for y, z in yz)
    )


def _second_ball(yz: Array) -> str:
    a = np.linspace(-0.9, 0.9, 70)
    other = np.column_stack([70 + 18.5 * np.sin(a), yz[:, 1].mean() + 15 - 18.5 * np.cos(a)])
    return _text(np.vstack([yz, other]))


def _later_rows(folder: Path) -> None:
    header, *rows = (folder / "frames.csv").read_text().splitlines()
    cells = [r.split(",") for r in rows]
    names = [c[1] for c in cells]
    rows = [",".join([c[0], name, *c[2:]]) for c, name in zip(cells, names[1:] + names[:1], strict=True)]
    (folder / "frames.csv").write_text("\n".join([header, *rows]) + "\n")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: _each(f, _with_commas(",")), "separated by semicolons or tabs"),
        (lambda f: _each(f, lambda yz: _text(yz / 1000)), "as if in metres"),
    ],
)
def test_unusable_profiles_end_in_a_sentence(
    cli: Cli, ball: Path, tmp_path: Path, change: Callable[[Path], None], words: str
) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(ball, folder)
    change(folder)
    outcome = cli("calibrate", folder)
    assert outcome.code == 2
    assert words in outcome.err


def test_decimal_commas_between_semicolons_change_nothing(cli: Cli, ball: Path, tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(ball, folder)
    _each(folder, _with_commas(";"))
    outcome = cli("calibrate", folder, "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.json["verdict"]["code"] == "ok"


def test_mixed_formats_are_each_read_as_their_own_or_left_out_by_name(cli: Cli, ball: Path, tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(ball, folder)
    frames = sorted((folder / "profiles").iterdir())
    for path, kind in ((frames[1], "gocator"), (frames[9], "npy")):
        yz = np.loadtxt(path, delimiter=",", skiprows=1)
        other = path.with_suffix(".npy") if kind == "npy" else path
        write_scan_lines(other, [ScanLine(yz[:, 0], yz[:, 1])], Told(kind))
        edit(folder / "frames.csv", f"profiles/{path.name}", f"profiles/{other.name}")
    mixed = cli("calibrate", folder, "--json")
    assert mixed.code == 0, mixed.err
    whole = cli("calibrate", ball, "--json").json
    assert len(mixed.json["frames"]) == len(whole["frames"])
    apart = np.subtract(mixed.json["T_hand_sensor"], whole["T_hand_sensor"])
    assert np.abs(apart).max() < 0.01  # a format of three decimals
    edit(folder / "sensor.toml", '"auto"', '"csv"')
    told = cli("calibrate", folder, "--json")
    out = {f["frame"]: f for f in told.json["frames"] if not f["used"]}
    assert sorted(out) == [1, 9]
    assert frames[1].name in str(out[1])


@pytest.mark.parametrize("stated", [39.0, 41.0])
def test_a_wrong_diameter_is_told_in_sigma(cli: Cli, ball: Path, tmp_path: Path, stated: float) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(ball, folder)
    edit(folder / "target.toml", "40", f"{stated:g}")
    outcome = cli("calibrate", folder, "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.json["verdict"]["code"] == "priors_contradict"
    assert f"{stated:g} mm by target.toml" in outcome.json["verdict"]["text"]
    assert "σ apart" in outcome.json["verdict"]["text"]


def test_two_balls_in_view_are_not_chosen_between(cli: Cli, ball: Path, tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(ball, folder)
    _each(folder, _second_ball)
    outcome = cli("calibrate", folder, "--json")
    assert outcome.code == 3
    assert outcome.json["T_hand_sensor"] is None
    assert all("two balls are in view" in f["complaint"] for f in outcome.json["frames"])


def test_profiles_out_of_step_with_their_poses_are_named(cli: Cli, ball: Path, tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(ball, folder)
    _later_rows(folder)
    outcome = cli("calibrate", folder, "--json")
    assert outcome.code == 3
    assert outcome.json["T_hand_sensor"] is None
    assert "out of step" in outcome.json["verdict"]["text"]


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rendered")
    plan, out = str(folder / "plan"), str(folder / "cell")
    assert run(["init", plan, "--target", "sphere", "--sensor", "lmi_gocator_2340"]) == 0
    assert run(["render", plan, "--out", out, "--profiles", "csv", "--per-location", "9", "--seed", "2"]) == 0
    return folder / "cell"


def _wider(pitch: float) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        for path in sorted((folder / "profiles").iterdir()):
            yz = np.genfromtxt(path, delimiter=",", skip_header=1)
            path.write_text(_text((yz * [pitch, 1.0])[np.isfinite(yz[:, 1])]))

    return change


def _one_pose_lost(frame: int) -> Callable[[Path], None]:
    """From a frame on every pose is written beside the profile after its own."""

    def change(folder: Path) -> None:
        header, *rows = (folder / "frames.csv").read_text().splitlines()
        cells = [r.split(",") for r in rows]
        names = [c[1] for c in cells]
        del names[frame]
        shifted = [",".join([c[0], name, *c[2:]]) for c, name in zip(cells[:-1], names, strict=True)]
        (folder / "frames.csv").write_text("\n".join([header, *shifted]) + "\n")

    return change


@pytest.mark.parametrize(
    ("change", "named"),
    [
        pytest.param(_wider(1.1), "had to be left out", id="wide", marks=pytest.mark.slow),
        pytest.param(_wider(0.9), "scale_y of sensor.toml: changed by +0.1", id="narrow", marks=pytest.mark.slow),
        pytest.param(_one_pose_lost(4), "out of step", id="early", marks=pytest.mark.slow),
        pytest.param(_one_pose_lost(18), "from frame 18 on profiles and poses are out of step", id="late"),
    ],
)
def test_rendered_profiles_with_a_wrong_pitch_or_a_lost_pose_are_no_answer(
    cli: Cli, rendered: Path, tmp_path: Path, change: Callable[[Path], None], named: str
) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(rendered, folder)
    change(folder)
    outcome = cli("calibrate", folder, "--json")
    assert outcome.code == 3, outcome.err
    assert outcome.json["T_hand_sensor"] is None
    assert outcome.json["verdict"]["code"] in ("frames_contradict", "sensor_suspect")
    assert named in outcome.json["verdict"]["text"]


def test_a_bent_plate_is_said(cli: Cli, tmp_path: Path) -> None:
    folder = tmp_path / "plate"
    _dataset(folder, Plane(), 'kind = "plane"\n', bend_mm=0.4)
    outcome = cli("calibrate", folder, "--json")
    assert outcome.code in (0, 3), outcome.err
    assert any("the plate is not flat" in note for note in outcome.json["notes"])
