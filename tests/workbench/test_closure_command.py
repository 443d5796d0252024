"""The command `closure`: recorded sockets, and files that are none."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.recordings import MISSING, recording
from workbench.cli.main import run

RECORDED = recording("real/socket_closure/data")


def test_iiwa_gains_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    if not RECORDED.is_dir():
        pytest.skip(MISSING)
    files = [str(p) for p in sorted((RECORDED / "kuka_14").glob("*/hole_?.csv"))]
    assert run(["closure", *files, "--robot", "kuka_iiwa14", "--distance-mm", "50", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["gains"] is False
    assert "no gain from the larger model" in answer["text"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty"),
        ("1,2,3\n", "line 1: 3 values"),
        ("1,2,x,4,5,6,7\n", "line 1: a value is not a number"),
    ],
)
def test_unusable_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, says: str) -> None:
    path = tmp_path / "hole_0.csv"
    path.write_text(text)
    assert run(["closure", str(path), "--robot", "kuka_iiwa14"]) == 2
    assert says in capsys.readouterr().err.replace("\n", " ")


def test_too_few_configurations_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "hole_0.csv"
    np.savetxt(path, np.zeros((2, 7)), delimiter=",")
    assert run(["closure", str(path), "--robot", "kuka_iiwa14"]) == 2
    assert "2 configurations" in capsys.readouterr().err.replace("\n", " ")


def test_panda_is_calibrated_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The JSON has what docs/formats.md says; a wrong distance, degrees and another arm are named."""
    if not RECORDED.is_dir():
        pytest.skip(MISSING)
    files = [str(p) for p in sorted((RECORDED / "panda_4").glob("*/hole_?.csv"))]
    out = tmp_path / "robot.toml"
    panda = ["closure", *files, "--robot", "franka_panda"]
    assert run([*panda, "--distance-mm", "50", "--json", "--out", str(out)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["verdict"]["code"] == "ok"
    assert answer["kept"] == "calibrated"
    for written, said in zip(tomllib.loads(out.read_text())["joint"], answer["robot"]["joint"], strict=True):
        assert written == pytest.approx(said, abs=1e-6)
    assert answer["pulls"][0]["parameter"] == "theta5"
    seen = np.sqrt(np.mean([h["calibrated_rms_mm"] ** 2 for h in answer["held_out"]]))
    assert answer["predicted_sigma_mm"] == pytest.approx(seen, rel=0.3)
    assert run([*panda, "--distance-mm", "49", "--json"]) == 3
    refused = json.loads(capsys.readouterr().out)
    assert refused["verdict"]["code"] == "distance_contradicts"
    assert refused["tool_mm"] is None
    assert run([*panda, "--degrees"]) == 2
    assert "as if in radians" in capsys.readouterr().err.replace("\n", " ")


def test_another_arm_is_named_with_the_preset_that_closes(capsys: pytest.CaptureFixture[str]) -> None:
    if not RECORDED.is_dir():
        pytest.skip(MISSING)
    files = [str(p) for p in sorted((RECORDED / "kuka_14").glob("*/hole_?.csv"))]
    assert run(["closure", *files, "--robot", "franka_panda", "--distance-mm", "50", "--json"]) == 3
    verdict = json.loads(capsys.readouterr().out)["verdict"]
    assert verdict["code"] == "robot_contradicts"
    assert "kuka_iiwa14 closes them to 0.5" in verdict["text"]


def test_degrees_in_radian_files_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "hole_0.csv"
    np.savetxt(path, np.full((4, 7), 40.0), delimiter=",")
    assert run(["closure", str(path), "--robot", "kuka_iiwa14"]) == 2
    assert "say --degrees" in capsys.readouterr().err.replace("\n", " ")
