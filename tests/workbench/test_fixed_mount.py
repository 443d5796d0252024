"""[mount] sensor = "fixed" in cell.toml: planned, rendered, calibrated against its truth; wrong keys are named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import workbench.plan.next_view
import workbench.plan.proposal
from calib.printed import nees
from geometry import Pose, toml_value
from tests.workbench.helpers import Cli
from workbench.cell import write_starter
from workbench.files import read_cell, read_frames

FIXED = Pose.from_fixed_xyz_deg((3.0, -87.0, 2.0), (1900.0, 60.0, 1100.0))  # depth towards the arm
MOUNTED = {
    "A": Pose.from_fixed_xyz_deg((180.0, 0.0, 0.0), (0.0, 10.0, 160.0)),
    "B": Pose.from_fixed_xyz_deg((192.0, -8.0, 60.0), (20.0, -15.0, 160.0)),
}
NEES_LIMIT = 22.5  # of six numbers: 1 in 1,000


def _cell(folder: Path) -> Path:
    write_starter(folder, "abb_irb6640_180_255", "nominal", "paper")
    text = (folder / "cell.toml").read_text().split("[scp_initial]")[0]
    text += f"[scp_initial]\nrotation_deg = {toml_value(FIXED.fixed_xyz_deg.tolist())}\n"
    text += f'translation_mm = {toml_value(FIXED.t.tolist())}\n[mount]\nsensor = "fixed"\n'
    for name, place in MOUNTED.items():
        text += f"[locations.{name}]\nT_hand_jig = {toml_value(place.matrix.tolist())}\n"
    (folder / "cell.toml").write_text(text)
    return folder


def test_it_is_rendered_and_calibrated(cli: Cli, tmp_path: Path) -> None:
    """Views are planned for the arm that carries the jig; the sensor's pose in the base is found within its σ."""
    cell, out = _cell(tmp_path / "cell"), tmp_path / "recording"
    made = cli("render", cell, "--out", out, "--per-location", 4, "--seed", 3)
    assert made.code == 0, made.err
    again = read_cell(out)
    assert again.mount == "fixed"
    truth = json.loads((out / "truth.json").read_text())
    result = cli("calibrate", out, "--json")
    assert result.code == 0, result.err
    answer = result.json
    assert answer["mount"] == "fixed"
    assert answer["T_base_sensor"] == answer["T_hand_sensor"]
    true = Pose.from_matrix(truth["T_hand_sensor"])
    found = Pose.from_matrix(answer["T_base_sensor"])
    assert nees(true, found, np.array(answer["covariance"])) < NEES_LIMIT
    assert np.linalg.norm(true.t - FIXED.t) > 0.1  # it was not where the drawing says
    assert any("the hand carries the target" in n for n in answer["notes"])


def test_it_is_planned_and_drawn(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The hand brings the jig before the sensor at every proposed configuration, within the field of view."""
    monkeypatch.setattr(workbench.plan.proposal, "POOL", 12)
    folder = _cell(tmp_path / "cell")
    result = cli("plan", folder, "--per-location", 2, "--json", "--picture", tmp_path / "plan.png")
    assert result.code == 0, result.err
    cell = read_cell(folder, recorded=False)
    for frame in result.json["frames"]:
        hand = cell.arm.pose(np.deg2rad(frame["joints_deg"]))
        seen = FIXED.inverse() @ hand @ MOUNTED[frame["location"]] @ cell.jig.anchors_mm.mean(axis=0)
        assert abs(seen[0]) < 60  # the sheet cuts the pillar
        assert 200 < seen[2] < 700
        assert frame["room_mm"] > 0
    assert (tmp_path / "plan.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("T_hand_jig", "T_base_jig"), "T_hand_jig is right"),
        (('sensor = "fixed"', 'sensor = "hand"'), "T_base_jig is right"),
        (('sensor = "fixed"', 'sensor = "wall"'), "[mount] sensor"),
        (("[mount]", "[mounted]"), 'did you mean "mount"'),
    ],
)
def test_wrong_keys_are_named(change: tuple[str, str], words: str, cli: Cli, tmp_path: Path) -> None:
    folder = _cell(tmp_path / "cell")
    file = folder / "cell.toml"
    file.write_text(file.read_text().replace(*change))
    result = cli("plan", folder)
    assert result.code == 2
    assert words in result.err


@pytest.mark.parametrize("mount", ["hand", "fixed"])
def test_views_of_a_ball_are_planned_and_drawn(
    mount: str, cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every proposed view cuts the ball by the truth of the chain; picture and page are written."""
    monkeypatch.setattr(workbench.plan.next_view, "POOL", 40)
    folder = _cell(tmp_path / "cell") if mount == "fixed" else tmp_path / "cell"
    if mount == "hand":
        write_starter(folder, "abb_irb6640_180_255", "nominal", "paper")
    (folder / "target.toml").write_text('kind = "sphere"\ndiameter_mm = 40\n')
    text = (folder / "cell.toml").read_text().splitlines()
    lines = ['target = "target.toml"' if line.startswith("jig") else line for line in text]
    (folder / "cell.toml").write_text("\n".join(lines) + "\n")
    call = ("plan", folder, "--per-location", 3, "--json", "--out", tmp_path / "views.csv")
    made = cli(*call, "--picture", tmp_path / "p.png", "--report", tmp_path / "p.html")
    assert made.code == 0, made.err
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    assert "proposed" in (tmp_path / "p.html").read_text()
    cell = read_cell(folder, recorded=False)
    rows = read_frames(tmp_path / "views.csv", cell.arm.n_joints)
    assert {r.location for r in rows} <= set(cell.T_base_jig)
    for row in rows:
        hand = cell.arm.pose(row.joints_rad)
        place = cell.T_base_jig[row.location]
        sensor = cell.design if mount == "fixed" else hand @ cell.design
        ball = hand @ place if mount == "fixed" else place
        assert abs((sensor.inverse() @ ball).t[0]) < 20.0  # the sheet cuts it
        assert bool(cell.arm.within_limits(row.joints_rad))
