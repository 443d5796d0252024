"""`doctor DATASET`: a half-filled dataset is looked through file by file, and nothing ends the look but its end."""

from __future__ import annotations

import json
from pathlib import Path

from tests.workbench.helpers import Cli, edit
from workbench.files import examine_cell


def _lines(folder: Path) -> dict[str, tuple[str, str]]:
    return {f.what: (f.state, f.detail) for f in examine_cell(folder)}


def test_a_whole_dataset(cli: Cli, dataset: Path) -> None:
    result = cli("doctor", dataset)
    assert result.code == 0
    for words in ("frame 0  calibrate at A: images/000.png", "to verify  3 at D", "1280 × 1024 px, 8 bits"):
        assert words in result.out
    assert "missing" not in result.out


def test_a_starter(cli: Cli, tmp_path: Path) -> None:
    """`init` names the command, and the command what is to be filled in."""
    folder = tmp_path / "new"
    result = cli("init", folder)
    assert f"perceptron-emu doctor {folder}" in " ".join(result.err.split())
    lines = _lines(folder)
    assert lines["frames.csv"][0] == "missing"
    assert lines["robot.toml"] == ("ok", "6 joints")
    assert cli("doctor", folder).code == 2


def test_what_is_wrong_is_said_of_its_file(dataset: Path) -> None:
    (dataset / "images" / "001.png").unlink()
    (dataset / "images" / "002.png").write_bytes(b"")
    (dataset / "images" / "099.png").write_bytes(b"")
    frames = (dataset / "frames.csv").read_text().splitlines()
    cells = frames[4].split(",")
    cells[4] = "171.5"
    (dataset / "frames.csv").write_text("\n".join([*frames[:4], ",".join(cells), *frames[5:]]) + "\n")
    lines = _lines(dataset)
    assert lines["frame 1"][0] == lines["frame 2"][0] == lines["frame 3"][0] == "missing"
    assert "image_unreadable" in lines["frame 1"][1]
    assert "0 bytes" in lines["frame 2"][1]
    assert "joint 1 reads 171.5°" in lines["frame 3"][1]
    assert lines["images/099.png"][0] == "doubtful"
    assert lines["frame 0"] == ("ok", "calibrate at A: images/000.png")


def test_a_broken_file_hides_no_other(dataset: Path) -> None:
    edit(dataset / "robot.toml", "d_mm", "b_mm")
    (dataset / "jig.toml").unlink()
    edit(dataset / "cell.toml", "[scp_initial]", "[locations.Q]\n[scp_initial]")
    lines = _lines(dataset)
    assert lines["robot.toml"][0] == "broken"
    assert "b_mm" in lines["robot.toml"][1]
    assert lines["jig.toml"][0] == "missing"
    assert lines["sensor.toml"][0] == "ok"


def test_every_wrong_row_is_named_and_hides_no_other(dataset: Path) -> None:
    path = dataset / "frames.csv"
    header, *rows = path.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    cells[1][4] = "about 12"
    cells[4][0] = cells[3][0]
    cells[7][2] = cells[7][2].lower()
    cells[8][3] = "test"
    cells[9] += ["", "7"]
    path.write_text("\n".join([header, *map(",".join, cells)]) + "\n")
    found = [f for f in examine_cell(dataset) if f.what == "frames.csv"]
    assert [f.state for f in found] == ["broken"] * 5
    for finding, words in zip(
        found,
        (
            'line 3, column j1_deg: "about 12"',
            'line 10, column role: "test"',
            "line 11: ",
            "line 6: frame 3 stands",
            "line 9: loc",
        ),
        strict=True,
    ):
        assert words in finding.detail
    lines = _lines(dataset)
    assert lines["frame 0"] == ("ok", "calibrate at A: images/000.png")
    assert "frame 1" not in lines


def test_as_json(cli: Cli, dataset: Path, tmp_path: Path) -> None:
    """The same findings as one object, in the same order, with the same exit code."""
    result = cli("doctor", dataset, "--json")
    said = json.loads(result.out)
    assert (result.code, said["usable"]) == (0, True)
    assert [(f["state"], f["what"], f["detail"]) for f in said["findings"]] == [
        (f.state, f.what, f.detail) for f in examine_cell(dataset)
    ]
    result = cli("doctor", tmp_path / "nothing", "--json")
    assert (result.code, json.loads(result.out)["usable"]) == (2, False)


def test_no_dataset_at_all(tmp_path: Path) -> None:
    assert [f.state for f in examine_cell(tmp_path)] == ["missing"]
    (tmp_path / "cell.toml").write_text("sensor = 3\n")
    assert [f.state for f in examine_cell(tmp_path)] == ["broken"]
