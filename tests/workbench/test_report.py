"""The HTML report: self-contained, escaped, and there also when there is no answer."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import workbench
from tests.workbench.helpers import Cli, edit
from workbench.cell import observe, solve
from workbench.files import read_cell
from workbench.report import scene_object

ATOL_ON_STRING_MM = 0.3  # of an emulated recording's points, by the solved chain: four times their rms


def test_the_report_stands_alone(cli: Cli, dataset: Path, tmp_path: Path) -> None:
    """No address outside the file, no script but its own, names escaped, one image unreadable."""
    text = (dataset / "cell.toml").read_text()
    name = next(line for line in text.splitlines() if line.startswith("name"))
    edit(dataset / "cell.toml", name, 'name = "<script>alert(1)</script>"')
    (dataset / "images" / "010.png").write_bytes(b"")
    page = tmp_path / "report.html"
    assert cli("calibrate", dataset, "--report", page).code == 0
    html = page.read_text(encoding="utf-8")
    program = re.findall(r"<script>(.*?)</script>", html, flags=re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(program[0].encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in html
    assert (len(program), html.count("<script")) == (1, 2)  # the other one holds data
    scene = json.loads(re.findall(r'<script type="application/json" id="scene">(.*?)</script>', html)[0])
    assert len(scene["frames"]) == 12
    assert {t["location"] for t in scene["targets"]} == {"A", "B", "C", "D"}
    assert "&lt;script&gt;" in html
    assert not re.findall(r"""(?:src|href)=["'](?!data:)""", html)
    assert "image_unreadable" in html
    for heading in ("Fig. 7", "95 % interval", "Each location predicted by the others", "Worst frames", "KUKA"):
        assert heading in html


def test_makers_numbers_are_of_the_pose_for_the_controller_s_table(cli: Cli, dataset: Path, tmp_path: Path) -> None:
    """Screen, report and JSON agree on it with --export: with robot errors solved for, it is not T_hand_sensor."""
    page, tool = tmp_path / "page.html", tmp_path / "tool.txt"
    result = cli("calibrate", dataset, "--model", "full", "--json", "--report", page, "--export", "kuka", tool).json
    x = result["T_hand_sensor_nominal"][0][3]
    assert x in result["conventions_nominal"]["kuka"].values()
    assert abs(x - result["T_hand_sensor"][0][3]) > 1e-3
    assert f"X {x:.4f}" in tool.read_text()
    shown = cli("calibrate", dataset, "--model", "full").out
    line = next(row for row in shown.splitlines() if row.strip().startswith("KUKA"))
    assert f"x {x:.7g}," in line
    assert "nominal table" in shown.splitlines()[shown.splitlines().index(line) - 1]
    text = page.read_text(encoding="utf-8")
    assert "with the nominal table" in text
    assert "For a controller with its nominal table" in text
    plain = cli("calibrate", dataset, "--model", "scp").out
    assert "The same pose as makers write it" in plain


def test_a_report_without_an_answer(cli: Cli, dataset: Path, tmp_path: Path) -> None:
    lines = (dataset / "frames.csv").read_text().splitlines()
    (dataset / "frames.csv").write_text("\n".join(lines[:2]) + "\n")
    page = tmp_path / "report.html"
    assert cli("calibrate", dataset, "--report", page).code == 3
    assert "too_few_poses" in page.read_text(encoding="utf-8")


def without_drawing(html: str) -> str:
    """The page without the cell as OpenGL draws it, whose edges differ from run to run."""
    return re.sub(r'(alt="Arm, sensor with its sheet[^"]*" src=")[^"]*', r"\1", html)


def test_a_report_is_a_record(cli: Cli, dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Data set, date, version, hashes of files and settings, pass or fail; the same bytes but for the date."""
    pages = []
    for seconds in ("1700000000", "1800000000"):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", seconds)
        assert cli("calibrate", dataset, "--report", tmp_path / f"{seconds}.html").code == 0
        pages.append(without_drawing((tmp_path / f"{seconds}.html").read_text(encoding="utf-8")))
    html = pages[0]
    assert pages[1].replace("2027-01-15", "2023-11-14") == html
    for word in (
        "2023-11-14",
        f"perceptron-emu {version('perceptron-emu')}",
        "<td>pass</td>",
        f"<td>{dataset.name}</td>",
    ):
        assert word in html
    for name in ("sensor.toml", "frames.csv", "images/000.png"):
        assert f"<td>{name}</td>" in html
        assert hashlib.sha256((dataset / name).read_bytes()).hexdigest() in html


def test_a_fixed_sensor_stands_and_the_hand_carries_the_target(recording: Path) -> None:
    """The sensor is in one place of the scene, the strings are in another in every frame."""
    cell = read_cell(recording)
    result = solve(cell, observe(cell))
    scene = scene_object(replace(cell, mount="fixed"), result)
    assert scene["targets"] == []
    assert len({tuple(f["sensor"]) for f in scene["frames"]}) == 1
    assert len({str(f["target"]) for f in scene["frames"]}) == len(scene["frames"])


def test_the_scene_s_points_lie_on_its_targets(recording: Path) -> None:
    """Measured points in the base are on a string of their location."""
    cell = read_cell(recording)
    scene = scene_object(cell, solve(cell, observe(cell)))
    lines = {t["location"]: np.array(t["lines"]) for t in scene["targets"]}
    for frame in scene["frames"]:
        start, end = lines[frame["location"]].transpose(1, 0, 2)
        along = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
        off = np.array(frame["points"])[:, None] - start
        across = off - np.sum(off * along, axis=2, keepdims=True) * along
        assert np.linalg.norm(across, axis=2).min(axis=1).max() < ATOL_ON_STRING_MM


def test_every_page_is_of_one_kit() -> None:
    """No template has a head or colours of its own."""
    templates = [p for p in Path(workbench.__file__).parent.rglob("*.j2") if p.name != "record.html.j2"]
    assert len(templates) >= 6
    for path in templates:
        text = path.read_text(encoding="utf-8")
        assert text.startswith('{% extends "record.html.j2" %}'), path
        assert "<style" not in text, path
        assert not re.findall(r"#[0-9a-fA-F]{6}\b", text), path
