"""Bad files through the command line: exit code 2, one sentence that names file, line or key, and what is right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.workbench.helpers import Cli, edit, line_of

JOINTS = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg"


def _frames(change: Callable[[list[str]], None]) -> Callable[[Path], None]:
    def breaks(dataset: Path) -> None:
        lines = (dataset / "frames.csv").read_text().splitlines()
        change(lines)
        (dataset / "frames.csv").write_text("\n".join(lines) + "\n")

    return breaks


def _cell(line: int, column: int, value: str) -> Callable[[Path], None]:
    def change(lines: list[str]) -> None:
        cells = lines[line - 1].split(",")
        cells[column] = value
        lines[line - 1] = ",".join(cells)

    return _frames(change)


def _edit(name: str, old: str, new: str) -> Callable[[Path], None]:
    return lambda dataset: edit(dataset / name, old, new)


def _write(name: str, data: bytes) -> Callable[[Path], object]:
    return lambda dataset: (dataset / name).write_bytes(data)


CASES: dict[str, tuple[Callable[[Path], object], tuple[str, ...]]] = {
    "no cell.toml": (lambda d: (d / "cell.toml").unlink(), ("no cell.toml", "init")),
    "zero-byte cell.toml": (_write("cell.toml", b""), ("cell.toml", "empty")),
    "zero-byte frames.csv": (_write("frames.csv", b""), ("frames.csv", "empty")),
    "binary sensor.toml": (_write("sensor.toml", b"\xff\xfe\x00[image]"), ("sensor.toml, line 1", "UTF-8")),
    "not TOML": (_edit("jig.toml", "side_mm =", "side_mm"), ("jig.toml, line", "TOML")),
    "missing file": (
        _edit("cell.toml", '"jig.toml"', '"jigs.toml"'),
        ("cell.toml, line", 'jigs.toml is no file: did you mean "jig.toml"'),
    ),
    "missing file beside others": (
        lambda d: (d / "sensor.toml").unlink(),
        ("cell.toml, line", "sensor.toml is no file: put it there, or name the file that holds it"),
    ),
    "camera in metres": (
        _edit("sensor.toml", "translation_mm = [120.0, 0.0, 0.0]", "translation_mm = [0.12, 0.0, 0.0]"),
        ("sensor.toml", "[camera.pose] translation_mm", "0.12 mm from the laser plane", "millimetres"),
    ),
    "preset for a file": (
        _edit("cell.toml", '"robot.toml"', '"abb_irb2400"'),
        ("cell.toml, line", "it is a preset", "init --robot abb_irb2400"),
    ),
    "folder for a file": (_edit("cell.toml", '"jig.toml"', '"images"'), ("cell.toml, line", "no file")),
    "unknown key": (_edit("sensor.toml", "fx_px", "fx_pix"), ("sensor.toml, line", "fx_pix", '"fx_px"')),
    "unknown key without its unit": (_edit("sensor.toml", "fx_px", "fx"), ("[camera] fx", 'did you mean "fx_px"')),
    "unknown key of a joint": (_edit("robot.toml", "alpha_deg", "alpha"), ("robot.toml, line", 'mean "alpha_deg"')),
    "column without its unit": (_edit("frames.csv", "j3_deg", "j3"), ("frames.csv, line 1", 'did you mean "j3_deg"')),
    "unknown section": (_edit("sensor.toml", "[exposure]", "[exposition]"), ("sensor.toml, line", "exposition")),
    "unknown emulation key": (_edit("sensor.toml", "time_ms", "time_s"), ("[exposure] time_s", '"time_ms"')),
    "NaN": (_edit("sensor.toml", "fx_px = 2300.0", "fx_px = nan"), ("sensor.toml, line", "fx_px", "finite")),
    "infinity": (_edit("jig.toml", "side_mm = 100.0", "side_mm = inf"), ("jig.toml, line", "side_mm", "finite")),
    "text for a number": (_edit("robot.toml", "d_mm = 780.0", 'd_mm = "780"'), ("robot.toml, line", "d_mm")),
    "negative length": (_edit("jig.toml", "height_mm = 100.0", "height_mm = -100.0"), ("jig.toml", "height_mm")),
    "missing key": (_edit("sensor.toml", "width_px = 1280", ""), ("sensor.toml", "width_px", "missing")),
    "bad bit depth": (_edit("sensor.toml", "bit_depth = 8", "bit_depth = 9"), ("sensor.toml", "bit_depth 9")),
    "terms of distortion": (_edit("sensor.toml", "0.0]\n[camera.pose]", "0.0, 1.0]\n[camera.pose]"), ("6 terms",)),
    "not a rotation": (_edit("sensor.toml", "rotation = [[0.0", "rotation = [[0.5"), ("sensor.toml", "rotation")),
    "joint limits": (_edit("robot.toml", "min_deg = -170.0", "min_deg = 170.0"), ("robot.toml, line", "min_deg")),
    "unknown convention": (_edit("robot.toml", '"standard"', '"craig"'), ("robot.toml", "modified")),
    "sign of a joint": (_edit("robot.toml", "d_mm = 780.0", "d_mm = 780.0\nsign = 2"), ("robot.toml, line", "sign")),
    "short vector": (
        _edit("cell.toml", "mm = [-17.0, ", "mm = ["),
        ("cell.toml, line", "number of values"),
    ),
    "location without frames": (
        _edit("cell.toml", '[locations."A"]', '[locations."AA"]'),
        ("cell.toml, line", "no frame"),
    ),
    "wrong column": (_edit("frames.csv", "location", "locaton"), ("frames.csv, line 1", "locaton", '"location"')),
    "missing column": (_edit("frames.csv", "j3_deg", "j4_deg"), ("frames.csv, line 1", "twice")),
    "no joints": (_edit("frames.csv", JOINTS, "a,b,c,d,e,f"), ("frames.csv, line 1", "neither joint columns")),
    "semicolons": (_write("frames.csv", b"frame;image;location;role\n"), ("frames.csv, line 1", "joint columns")),
    "NaN joint": (_cell(3, 5, "nan"), ("frames.csv, line 3", "j2_deg", "finite")),
    "empty joint": (_cell(3, 5, ""), ("frames.csv, line 3", "j2_deg", "empty")),
    "text joint": (_cell(4, 4, "1,5"), ("frames.csv, line 4", "11 values", "10 columns")),
    "misspelt role": (_cell(5, 3, "calibrat"), ("frames.csv, line 5", "calibrat", '"calibrate"')),
    "frame twice": (_cell(5, 0, "0"), ("frames.csv, line 5", "frame 0", "line 2")),
    "frame is no number": (_cell(2, 0, "1.5"), ("frames.csv, line 2", "frame", "whole number")),
    "spelling of a location": (_cell(3, 2, "a"), ("frames.csv, line 3", '"a"', '"A"')),
    "jig and target": (
        _edit("cell.toml", 'jig = "jig.toml"', 'jig = "jig.toml"\ntarget = "jig.toml"'),
        ("cell.toml, line", "keep one of them"),
    ),
    "no jig": (_edit("cell.toml", 'jig = "jig.toml"', ""), ("cell.toml", "the key jig is missing")),
    "target without kind": (
        _edit("cell.toml", 'jig = "jig.toml"', 'target = "jig.toml"'),
        ("jig.toml", "the key kind is missing"),
    ),
    "target of another kind": (
        _edit("jig.toml", "side_mm", 'kind = "sphere"\nside_mm'),
        ("jig.toml, line", 'kind = "sphere"', "string jig is needed"),
    ),
    "a sensor on the moon": (_edit("cell.toml", "mm = [-17.0, ", "mm = [3.8e11, "), ("cell.toml, line", "100000")),
    "a noise of nothing": (
        _edit("robot.toml", "joint_sigma_deg = ", "joint_sigma_deg = 1e-300 # "),
        ("robot.toml, line", "joint_sigma_deg", "too small"),
    ),
    "a device": (_edit("cell.toml", '"jig.toml"', '"/dev/zero"'), ("cell.toml, line", "/dev/zero", "no file")),
    "sentinel joint": (_cell(3, 5, "-9999"), ("frames.csv, line 3", "j2_deg", "missing value")),
    "no rows": (_frames(lambda lines: lines.__delitem__(slice(1, None))), ("frames.csv", "no frames")),
}


@pytest.mark.parametrize("case", CASES)
def test_one_sentence_and_exit_code_2(cli: Cli, dataset: Path, case: str) -> None:
    breaks, words = CASES[case]
    breaks(dataset)
    result = cli("calibrate", dataset, "--json")
    assert result.code == 2
    assert result.out == ""
    assert result.err.startswith("error: ")
    assert len(result.err.splitlines()) == 1
    for word in words:
        assert word in result.err


def test_the_line_is_the_right_one(cli: Cli, dataset: Path) -> None:
    edit(dataset / "sensor.toml", "fy_px", "fypx")
    line = line_of(dataset / "sensor.toml", "fypx")
    assert f"sensor.toml, line {line}:" in cli("calibrate", dataset).err


def test_radians_under_a_degree_header(cli: Cli, dataset: Path) -> None:
    import numpy as np

    lines = (dataset / "frames.csv").read_text().splitlines()
    for i, line in enumerate(lines[1:], start=1):
        cells = line.split(",")
        cells[4:] = [f"{np.deg2rad(float(c)):.6f}" for c in cells[4:]]
        lines[i] = ",".join(cells)
    (dataset / "frames.csv").write_text("\n".join(lines) + "\n")
    result = cli("calibrate", dataset)
    assert result.code == 2
    assert "radians" in result.err


def test_quaternion_of_wrong_length(cli: Cli, dataset: Path) -> None:
    header = "frame,image,location,role,x_mm,y_mm,z_mm,qw,qx,qy,qz"
    (dataset / "frames.csv").write_text(f"{header}\n0,images/000.png,A,calibrate,1,2,3,1,1,0,0\n")
    result = cli("calibrate", dataset)
    assert result.code == 2
    assert "line 2" in result.err
    assert "quaternion" in result.err


def test_names_comments_and_spaces_are_welcome(cli: Cli, dataset: Path, answer: Any) -> None:
    """A byte-order mark, CRLF, comments, blank lines, spaces and `name` in every table change nothing."""
    lines = (dataset / "frames.csv").read_text().splitlines()
    spaced = ["# comment", ", ".join(lines[0].split(",")), "", *(line.replace(",", " , ") for line in lines[1:])]
    (dataset / "frames.csv").write_bytes(b"\xef\xbb\xbf" + "\r\n".join(spaced).encode() + b"\r\n")
    for name, table in (("sensor.toml", "[image]"), ("sensor.toml", "[camera.pose]"), ("robot.toml", "[[joint]]")):
        edit(dataset / name, table, f'{table}\nname = "a name" # comment')
    edit(dataset / "cell.toml", "[scp_initial]", '[scp_initial]\nname = "design"\n#')
    (dataset / "jig.toml").write_bytes(b"\xef\xbb\xbf" + (dataset / "jig.toml").read_bytes())
    after = cli("calibrate", dataset, "--json")
    assert after.code == 0, after.err
    hashes = {"inputs"}
    assert {k: v for k, v in after.json.items() if k not in hashes} == {
        k: v for k, v in answer.items() if k not in hashes
    }


POINTS = "frame,label,u_px,v_px,y_surface_mm,z_surface_mm,y_mm,z_mm,sigma_y_mm,sigma_z_mm,cov_yz_mm2,score,flag\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ("empty",)),
        ("frame,label\n0,A\n", ("line 1", "y_mm")),
        (POINTS + "0,Q,,,,,1,2,0.01,0.01,0,1,\n", ("line 2", "label", '"Q"')),
        (POINTS + "0,A,,,,,1,2,0,0.01,0,1,\n", ("line 2", "sigma_y_mm")),
        (POINTS + "0,A,,,,,nan,2,0.01,0.01,0,1,\n", ("line 2", "y_mm")),
        (POINTS + "0,A,,,,,1,,0.01,0.01,0,1,\n", ("line 2", "z_mm", "empty")),
        (POINTS + "0,,,,,,1,2,0.01,0.01,0,1,\n", ("line 2", "label")),
        (POINTS + "0,A,,,,,1,2,0.01,0.01,1,1,\n", ("line 2", "cov_yz_mm2")),
        (POINTS + "0,A,,,,,1,2,0.01,0.01,0,1,\n0,A,,,,,1,2,0.01,0.01,0,1,\n", ("line 3", "second")),
        (POINTS + "99,A,,,,,1,2,0.01,0.01,0,1,\n", ("frame 99",)),
        (POINTS + "0,A\n", ("line 2", "holds no point")),
        (POINTS, ("holds a header but no points",)),
        (POINTS + "0,A,,,,,1,240000,0.01,0.01,0,1,\n", ("line 2", "z_mm", "millimetres are right")),
    ],
)
def test_bad_points(cli: Cli, dataset: Path, text: str, words: tuple[str, ...]) -> None:
    edit(dataset / "cell.toml", 'frames = "frames.csv"', 'frames = "frames.csv"\npoints = "points.csv"')
    (dataset / "points.csv").write_text(text)
    result = cli("calibrate", dataset)
    assert result.code == 2
    for word in ("points.csv", *words):
        assert word in result.err
