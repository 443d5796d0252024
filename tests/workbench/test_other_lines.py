"""Lines that are no pillar, from a target.toml through planning, images and points to the answer."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib import CalibConfig
from calib.label.frame import label_frame
from calib.pose.fit import jig_pose
from extraction import extract
from jig_cad import Jig
from perceptron_emu import Scene, render
from tests.workbench.helpers import Cli, edit
from workbench.cell import find_emulator, find_sensor, jig_bodies
from workbench.files import read_cell
from workbench.plan import ViewLimits, free_views

TARGET = """\
kind = "strings"
name = "five lines of two plates"
string_diameter_mm = 0.3
tolerance_mm = 0.1
[anchors_mm]
a = [0, 0, 0]
"b [top]" = [100, 10, 5]
c = [0, -55, 70]
d = [95, -40, 80]
e = [5, 50, 85]
f = [100, 60, 60]
[strings]
S1 = ["a", "b [top]"]
left-front = ["c", "d"]
right = ["e", "f"]
"fall [steep]" = ["b [top]", "c"]
rise = ["a", "f"]
"""
TEN = {
    "p1": (0, -40, 10), "p2": (100, -30, 20), "p3": (0, 45, 0), "p4": (100, -20, 60), "p5": (5, -10, 80),
    "p6": (95, 30, 30), "p7": (0, 20, 40), "p8": (105, 55, 75), "p9": (0, -55, 50), "p10": (100, 10, -5),
}  # fmt: skip
LINES = {"front": ("p1", "p2"), "left": ("p3", "p4"), "back": ("p5", "p6"), "right": ("p7", "p8"), "S5": ("p9", "p10")}


def test_an_image_of_five_lines_gives_their_pose() -> None:
    """No shared anchors, no parallel strings, a block at each end; nothing known but the jig and the sensor."""
    jig, sensor = Jig.of_lines(TEN, LINES, tolerance_mm=0.0), find_sensor("nominal")
    rng = np.random.default_rng(3)
    for i in range(2):
        T = free_views(sensor, jig, ViewLimits(), 2, rng)[i]
        blocks = tuple(replace(block, T_sensor_mesh=T @ block.T_sensor_mesh) for block in jig_bodies(jig))
        frame = render(Scene(sensor, jig, T, blocks), find_emulator("nominal"), rng)
        labelled = label_frame(extract(frame.image, sensor), jig, sensor, None, CalibConfig())
        assert set(labelled.axis.label) == set(jig.strings)
        true = {s.label: s.axis_mm for s in frame.truth.strings}
        for label, yz in zip(labelled.axis.label, labelled.axis.yz_mm, strict=True):
            assert np.linalg.norm(yz - true[label]) < 0.15
        found = jig_pose(labelled.axis, jig).candidates[0]
        off = found.T_sensor_jig @ jig.anchors_mm - T @ jig.anchors_mm
        assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 1.0


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from workbench.cli.main import run

    folder = tmp_path_factory.mktemp("lines")
    plan, out = folder / "plan", folder / "recording"
    assert run(["init", str(plan)]) == 0
    (plan / "jig.toml").unlink()
    (plan / "target.toml").write_text(TARGET)
    edit(plan / "cell.toml", 'jig = "jig.toml"', 'target = "target.toml"')
    assert run(["render", str(plan), "--out", str(out), "--per-location", "3", "--seed", "3"]) == 0
    return out


def test_a_recorded_cell_of_lines_is_calibrated(cli: Cli, recorded: Path) -> None:
    result = cli("calibrate", recorded, "--json")
    assert result.code == 0, result.err
    answer = result.json
    truth = json.loads((recorded / "truth.json").read_text())
    assert list(truth["anchors_mm"]) == ["a", "b [top]", "c", "d", "e", "f"]
    assert sum(f["used"] for f in answer["frames"]) >= 11
    labels = {p["label"] for f in answer["frames"] for p in f["points"]}
    assert labels == {"S1", "left-front", "right", "fall [steep]", "rise"}
    off = np.array(answer["T_hand_sensor"])[:3, 3] - np.array(truth["T_hand_sensor"])[:3, 3]
    assert np.linalg.norm(off) < 1.5
    assert cli("calibrate", recorded, "--method", "paper").code == 2


def test_points_of_lines_are_written_and_read(cli: Cli, recorded: Path, tmp_path: Path) -> None:
    """Extract's labels are the jig's names, and pose reads them beside the dataset's jig.toml."""
    assert cli("extract", recorded, "--csv", tmp_path / "points.csv").code == 0
    rows = list(csv.DictReader((tmp_path / "points.csv").read_text().splitlines()))
    assert {r["label"] for r in rows} - {""} == set(read_cell(recorded).jig.strings)
    posed = cli("pose", tmp_path / "points.csv", "--jig", recorded / "jig.toml", "--json")
    assert posed.code == 0, posed.err
    assert len(posed.json["frames"]) == 12
    shown = cli("jig", recorded / "jig.toml")
    assert "fall [steep]" in shown.out
    assert "b [top]" in shown.out
    for name in ("jig.stl", "jig.glb"):
        assert cli("jig", recorded / "jig.toml", "--export", tmp_path / name).code == 0
    refused = cli("jig", recorded / "jig.toml", "--export", tmp_path / "jig.svg")
    assert refused.code == 2
    assert "needs a triangular pillar" in refused.err
