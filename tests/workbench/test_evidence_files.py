"""[evidence] of cell.toml: the files that it names are read, used by calibrate, and named where they are wrong."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from geometry import Pose
from tests.workbench.helpers import Cli
from workbench.files import read_cell

TRACKER = Pose.exp(np.array([3500.0, -800.0, 400.0, 0.4, -0.3, 2.0]))  # T_tracker_base
REFLECTOR = np.array([30.0, -45.0, 120.0])


def _with(recording: Path, folder: Path, table: str) -> Path:
    shutil.copytree(recording, folder)
    file = folder / "cell.toml"
    file.write_text(f"{file.read_text()}\n[evidence]\n{table}\n")
    return folder


def _tracker_csv(recording: Path) -> str:
    """Positions of a reflector by the nominal arm, in a tracker's frame, some of them of a second one."""
    arm, rng = read_cell(recording).arm, np.random.default_rng(0)
    q = np.deg2rad(rng.uniform(-40, 40, (16, 6)))
    lines = ["point;x_mm;y_mm;z_mm;" + ";".join(f"j{k + 1}_deg" for k in range(6))]
    for k, (name, offset) in enumerate([("first", 0.0)] * 8 + [("second", 60.0)] * 8):
        p = TRACKER @ (arm.pose(q[k]) @ (REFLECTOR + offset)) + rng.normal(0, 0.02, 3)
        lines.append(";".join([name, *(f"{v:.4f}" for v in p), *(f"{v:.6f}" for v in np.rad2deg(q[k]))]))
    return "\n".join(lines) + "\n"


def test_a_trackers_positions_enter_the_answer(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """The same verdict, more known: σ of the SCP do not grow; the file stands among the inputs."""
    plain = cli("calibrate", recording, "--json").json
    folder = _with(recording, tmp_path / "cell", 'tracker = "tracker.csv"\ntracker_sigma_mm = 0.1')
    (folder / "tracker.csv").write_text(_tracker_csv(recording))
    assert len(read_cell(folder).evidence) == 2
    result = cli("calibrate", folder, "--json")
    assert result.code == 0, result.err
    answer = result.json
    assert any(i["file"].endswith("tracker.csv") for i in answer["inputs"])
    assert answer["solution"]["degrees_of_freedom"] > plain["solution"]["degrees_of_freedom"]
    assert answer["T_hand_sensor"] != plain["T_hand_sensor"]


@pytest.mark.parametrize(
    ("table", "csv", "words"),
    [
        ('tracker = "none.csv"', "", "is no file"),
        ('traker = "t.csv"', "", 'did you mean "tracker"'),
        ('tracker = "t.csv"', "x_mm,y_mm,z_mm,j1_deg\n1,2,3,4\n", 'column "j2_deg" is missing'),
        (
            'tracker = "t.csv"',
            "x_mm,y_mm,z_mm,j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg\n1,2,3,4,5,6,7,8,9\n",
            "4 or more",
        ),
        (
            'sockets = "t.csv"',
            "socket,j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg\na,1,2,3,4,5,6\n",
            "two or more are needed",
        ),
        ("tracker_sigma_mm = 0.0", "", "tracker_sigma_mm"),
        ('[[evidence.distance]]\nbetween = ["A", "A"]\ndistance_mm = 100.0', "", "tells nothing"),
        ('[[evidence.distance]]\nbetween = ["A", "B"]\ndistance_mm = -1.0', "", "distance_mm"),
    ],
)
def test_bad_evidence_is_one_sentence(
    table: str, csv: str, words: str, cli: Cli, recording: Path, tmp_path: Path
) -> None:
    folder = _with(recording, tmp_path / "cell", table)
    (folder / "t.csv").write_text(csv or "-\n")
    result = cli("calibrate", folder, "--json")
    assert result.code == 2
    assert words in result.err


def test_a_distance_to_a_place_that_no_frame_saw_is_said(recording: Path, tmp_path: Path) -> None:
    folder = _with(recording, tmp_path / "cell", '[[evidence.distance]]\nbetween = ["A", "Z"]\ndistance_mm = 300.0')
    assert any("names location Z, at which no frame was taken" in r for r in read_cell(folder).remarks)


def test_a_floor_that_is_none_is_asked_for_in_words(cli: Cli, recording: Path, tmp_path: Path) -> None:
    folder = _with(recording, tmp_path / "cell", "")
    (folder / "cell.toml").write_text((recording / "cell.toml").read_text() + "[workspace]\nfloor_z_mm = true\n")
    said = cli("calibrate", folder)
    assert said.code == 2
    assert "[workspace] floor_z_mm must be a number" in said.err
    assert "constrained" not in said.err
