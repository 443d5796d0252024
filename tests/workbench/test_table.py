"""Tables as people have them. Proves what is read and what is said; not that a spreadsheet writes just these."""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
import pytest

from geometry import Frame, InputError
from workbench.files import read_frames, read_points, read_table

HEADER = ["frame", "image", "location", "role", *(f"j{i}_deg" for i in range(1, 7))]
ROWS = [["0", "a.png", "A", "calibrate", *["10.5", "-20.25", "30", "40", "50", "60"]],
        ["1", "b.png", "A", "calibrate", *["11.5", "-21.25", "31", "41", "51", "61"]]]  # fmt: skip


def _write(folder: Path, header: list[str], rows: list[list[str]], separator: str = ",", **how: str) -> Path:
    path = folder / "frames.csv"
    text = "\r\n".join(separator.join(row) for row in [header, *rows]) + "\r\n"
    path.write_bytes(text.encode(how.get("encoding", "utf-8")))
    return path


def _degrees(frames: tuple[Frame, ...]) -> np.ndarray:
    return np.rad2deg([f.joints_rad for f in frames if f.joints_rad is not None])


WANTED = np.array([[10.5, -20.25, 30, 40, 50, 60], [11.5, -21.25, 31, 41, 51, 61]])
ATOL_DEG = 1e-12


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1"])
def test_separators_and_encodings(tmp_path: Path, separator: str, encoding: str) -> None:
    rows = [[*row[:2], "Süd", *row[3:]] for row in ROWS]
    frames = read_frames(_write(tmp_path, HEADER, rows, separator, encoding=encoding), 6)
    assert [f.location for f in frames] == ["Süd", "Süd"]
    np.testing.assert_allclose(_degrees(frames), WANTED, rtol=0, atol=ATOL_DEG)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas(tmp_path: Path, separator: str) -> None:
    rows = [[*row[:4], *(c.replace(".", ",") for c in row[4:])] for row in ROWS]
    frames = read_frames(_write(tmp_path, HEADER, rows, separator), 6)
    np.testing.assert_allclose(_degrees(frames), WANTED, rtol=0, atol=ATOL_DEG)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_every_cell_in_quotes(tmp_path: Path, separator: str) -> None:
    """As databases export."""
    header, rows = [f'"{c}"' for c in HEADER], [[f'"{c}"' for c in row] for row in ROWS]
    np.testing.assert_allclose(
        _degrees(read_frames(_write(tmp_path, header, rows, separator), 6)), WANTED, atol=ATOL_DEG
    )


@pytest.mark.parametrize("start", [b"PK\x03\x04\x14\0\6\0", b"\xd0\xcf\x11\xe0\xa1\xb1"])
def test_a_workbook_is_named(tmp_path: Path, start: bytes) -> None:
    (tmp_path / "frames.csv").write_bytes(start + b"\0" * 500)
    with pytest.raises(InputError, match=r"Excel workbook.*save the sheet as CSV"):
        read_frames(tmp_path / "frames.csv", 6)


def test_quoted_decimal_commas_between_commas(tmp_path: Path) -> None:
    rows = [[*row[:4], *(f'"{c}"'.replace(".", ",") for c in row[4:])] for row in ROWS]
    np.testing.assert_allclose(_degrees(read_frames(_write(tmp_path, HEADER, rows), 6)), WANTED, rtol=0, atol=ATOL_DEG)


def test_a_spreadsheet_s_leavings(tmp_path: Path) -> None:
    """``sep=``, an empty column at the end, rows of separators alone, cells left out at the end, 12 as 12.0."""
    path = tmp_path / "frames.csv"
    lines = ["sep=;", ";".join([*HEADER, "comment", "", ""]), ";" * 12, ";".join(["0.0", *ROWS[0][1:]])]
    lines += [";".join([*ROWS[1], "", "", ""]), ";" * 12, ";" * 12]
    path.write_text("\n".join(lines))
    said: list[str] = []
    frames = read_frames(path, 6, remark=said.append)
    np.testing.assert_allclose(_degrees(frames), WANTED, rtol=0, atol=ATOL_DEG)
    assert len(said) == 1
    assert '"comment"' in said[0]
    assert "line 2" in said[0]


@pytest.mark.parametrize("form", ["J{}", "A{}", "A{} [deg]", "j{} (°)", "Joint {}", "axis_{}_deg", "J{}_DEG"])
def test_controllers_headings(tmp_path: Path, form: str) -> None:
    header = ["Frame", "Image", "LOCATION", "role", *(form.format(i) for i in range(1, 7))]
    np.testing.assert_allclose(_degrees(read_frames(_write(tmp_path, header, ROWS), 6)), WANTED, rtol=0, atol=ATOL_DEG)


BAD = {
    "nearly known": ([*HEADER[:2], "locaton", *HEADER[3:]], ROWS, ('"locaton"', 'mean "location"')),
    "in radians": ([*HEADER[:4], *(f"j{i}_rad" for i in range(1, 7))], ROWS, ('"j1_rad"', 'mean "j1_deg"')),
    "both marks": (HEADER, [ROWS[0], [*ROWS[1][:4], '"11,5"', *ROWS[1][5:]]], ("line 3", "j1_deg", "from line 2")),
    "thousands": (HEADER, [ROWS[0], [*ROWS[1][:4], '"1.111,5"', *ROWS[1][5:]]], ("line 3", "j1_deg")),
    "unquoted commas": (HEADER, [[*ROWS[0][:4], *["1,5"] * 6]], ("line 2", "16 values", "semicolons")),
    "sentinel": (HEADER, [ROWS[0], [*ROWS[1][:4], "-9999.99", *ROWS[1][5:]]], ("line 3", "missing value")),
    "float's limit": (HEADER, [ROWS[0], [*ROWS[1][:4], "3.4028235e38", *ROWS[1][5:]]], ("line 3", "missing value")),
    "absurd": (HEADER, [ROWS[0], [*ROWS[1][:4], "1e30", *ROWS[1][5:]]], ("line 3", "1e30", "beyond")),
    "absurd turns": (HEADER, [ROWS[0], [*ROWS[1][:4], "1e5", *ROWS[1][5:]]], ("line 3", "j1_deg", "beyond")),
    "open quote": (HEADER, [ROWS[0], ['"1', *ROWS[1][1:]]], ("line 3",)),
    "zero bytes": (HEADER, [[*ROWS[0][:1], "a\0.png", *ROWS[0][2:]]], ("zero bytes",)),
}


@pytest.mark.parametrize("case", BAD)
def test_one_sentence(tmp_path: Path, case: str) -> None:
    header, rows, words = BAD[case]
    with pytest.raises(InputError) as error:
        read_frames(_write(tmp_path, header, rows), 6)
    assert "frames.csv" in str(error.value)
    assert "\n" not in str(error.value)
    for word in words:
        assert word in str(error.value)


def test_points_without_a_value_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("frame;y_surface_mm;z_surface_mm;Temp\n0;1,5;250\n0;-999,999;-999,999\n0;NaN;nan\n1;2;251;20\n")
    said: list[str] = []
    points = read_points(path, ["A"], said.append)
    assert [len(p.points.yz_mm) for p in points.values()] == [1, 1]
    assert "Temp" in said[0]
    assert "line 3" in said[1]


def test_a_long_table_takes_little_memory(tmp_path: Path) -> None:
    """A tenth of 700,000 rows; memory is the process's highest, so that what pytest holds is allowed for."""
    path = tmp_path / "points.csv"
    row = ",,{:.6f},{:.6f},0.030000,0.031000\n"
    with path.open("w") as stream:
        stream.write("frame,label,y_surface_mm,z_surface_mm,sigma_y_mm,sigma_z_mm\n")
        stream.writelines(f"{i // 700}" + row.format(i % 700 * 0.1, 250 + i % 7) for i in range(70_000))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    points = read_points(path, ["A"])
    grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert sum(len(p.points.yz_mm) for p in points.values()) == 70_000
    assert grown_mb < 60


@pytest.mark.parametrize("text", ["y_mm,z_mm\n1.5,2\n-3e-1, 4.25\n\n", "y_mm;z_mm\r\n1.5;2\r\n-3e-1;4.25\r\n"])
def test_plain_numbers_are_those_of_the_rows(text: str, tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_bytes(text.encode())
    table = read_table(path, ("y_mm", "z_mm"), ("z_mm",))
    plain = table.plain_numbers(["z_mm", "y_mm"])
    assert plain is not None
    assert plain.tolist() == [[r.number("z_mm"), r.number("y_mm")] for r in table.rows]


@pytest.mark.parametrize(
    "cells", ["1.5,", "1,nan", "1,-999.9998", "1,inf", "1,2,3", "1_0,2", "x,2", "# remark", '"1",2', "0x10,1", "1,1e3"]
)
def test_what_wants_a_closer_look_is_not_taken_at_once(cells: str, tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text(f"y_mm,z_mm\n1,2\n{cells}\n")
    assert read_table(path, ("y_mm", "z_mm"), ("z_mm",)).plain_numbers(["y_mm", "z_mm"]) is None
