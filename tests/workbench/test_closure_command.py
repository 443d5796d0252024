"""The command `closure`: recorded sockets, and files that are none."""

from __future__ import annotations

import json
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
        ("", "no joint readings"),
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
