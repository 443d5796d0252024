"""Profile files of every format: read as their makers write them, written and read back; what is missing is missing."""

import struct

import numpy as np
import pytest

from geometry import InputError
from geometry.sensor import PROFILE_FORMATS
from workbench.profiles import READERS, SUFFIXES, WRITERS, ScanLine, Told, convert, read_scan_lines, write_scan_lines

PITCH_MM, START_MM = 0.1, -20.0
# of half a unit in the last place that a format writes, and of LJ-X's finest unit that holds the heights
RESOLUTION_MM = {
    "csv": 1e-6, "gocator": 1e-4, "keyence_csv": 1e-4, "ply": 1e-6, "npy": 0.0, "keyence_lj_x": 1e-2,
    "opencv_yaml": 1e-6, "xyz": 1e-6,
}  # fmt: skip


def example(seed=0, n=401):
    rng = np.random.default_rng(seed)
    y = START_MM + PITCH_MM * np.arange(n)
    z = 270.0 + 0.002 * y**2 + rng.normal(size=n) * 0.02
    z[rng.random(n) < 0.2] = np.nan
    z[:7] = np.nan
    return ScanLine(y, z)


def test_every_format_of_the_table_can_be_read():
    asked = "csv gocator keyence_csv keyence_lj_x keyence_lj_v genicam sick wenglor opencv_yaml ply pcd xyz"
    assert set(asked.split()) <= set(READERS)
    assert set(PROFILE_FORMATS) == set(READERS)
    assert {"csv", "gocator", "keyence_csv", "ply", "npy"} <= set(WRITERS)


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("several", [False, True])
def test_a_profile_comes_back_to_the_formats_resolution(tmp_path, name, several):
    lines = (example(0), example(1)) if several else (example(0),)
    told = Told(name, PITCH_MM, START_MM, unit=1000 if name == "keyence_lj_x" else None)
    path = tmp_path / f"p{SUFFIXES[name]}"
    write_scan_lines(path, lines, told)
    for asked in (name, "auto"):
        back = read_scan_lines(path, Told(asked, PITCH_MM, START_MM, unit=told.unit))
        assert len(back) == len(lines)
        for before, after in zip(lines, back, strict=True):
            assert np.allclose(after.y_mm, before.y_mm, rtol=0, atol=RESOLUTION_MM[name] / 2 + 1e-9)
            assert np.array_equal(np.isnan(after.z_mm), np.isnan(before.z_mm))
            assert np.allclose(after.z_mm, before.z_mm, rtol=0, atol=RESOLUTION_MM[name] / 2 + 1e-9, equal_nan=True)


def test_keyence_heights_with_decimal_commas_and_every_kin_of_its_nines(tmp_path):
    path = tmp_path / "k.csv"
    path.write_text("-999,9999;12,5000;-99,9999;-9999,99;13,2500;-99999\n", encoding="utf-8")
    (line,) = read_scan_lines(path, Told("auto", 0.1, -0.3))
    assert np.allclose(line.y_mm, [-0.3, -0.2, -0.1, 0.0, 0.1, 0.2], rtol=0, atol=1e-12)
    assert np.array_equal(line.z_mm, [np.nan, 12.5, np.nan, np.nan, 13.25, np.nan], equal_nan=True)


def test_keyence_heights_down_to_99_are_heights(tmp_path):
    path = tmp_path / "k.csv"
    path.write_text("-99,-9.9,-98.9999\n", encoding="utf-8")
    assert np.all(read_scan_lines(path, Told("keyence_csv", 0.1))[0].present)


def test_keyence_without_a_pitch_takes_its_first_column_as_x_or_asks(tmp_path):
    path = tmp_path / "k.csv"
    path.write_text("0.0\t1.5\n0.1\t-999.999\n0.2\t1.7\n", encoding="utf-8")
    (line,) = read_scan_lines(path)
    assert np.array_equal(line.y_mm, [0.0, 0.1, 0.2])
    assert np.isnan(line.z_mm[1])
    path.write_text("1.5;1.6;1.7\n", encoding="utf-8")
    with pytest.raises(InputError, match="pitch-mm"):
        read_scan_lines(path)


def test_decimal_commas_between_commas_are_refused(tmp_path):
    path = tmp_path / "k.csv"
    path.write_text("12,3456,12,4567\n12,3400,12,4100\n", encoding="utf-8")
    with pytest.raises(InputError, match="decimal commas must be separated by semicolons or tabs"):
        read_scan_lines(path, Told("keyence_csv", 0.1))


GOCATOR = """Info,
Format Version,2
End,

DeviceInfo,
Model,2340
End,

Ranges,
Axis,Min,Max
X,-48,48
Z,-105,105
End,

"""


def test_gocator_profiles_with_intensity_and_missing_cells(tmp_path):
    path = tmp_path / "g.csv"
    body = "Profile,\nFrame,Source,Time,Encoder,Z Encoder,Inputs,Exposure,Y,Axis,-0.1,0.0,0.1\n"
    body += "7,0,0,0,0,0,800,0,Z,1.5,,1.7\n7,0,0,0,0,0,800,0,I,10,0,12\n8,0,0,0,0,0,800,0,Z,,2.5\nEnd,\n"
    path.write_text(GOCATOR + body, encoding="utf-8")
    first, second = read_scan_lines(path)
    assert (first.number, second.number) == (7, 8)
    assert np.array_equal(first.z_mm, [1.5, np.nan, 1.7], equal_nan=True)
    assert np.array_equal(first.intensity, [10, 0, 12])
    assert np.array_equal(second.z_mm, [np.nan, 2.5, np.nan], equal_nan=True)
    assert np.array_equal(first.range_mm, [[-48, 48], [-105, 105]])


def test_gocator_raw_profiles_and_parts(tmp_path):
    path = tmp_path / "g.csv"
    raw = "RawProfile,\nFrame,Axis,,\n3,X,0.11,0.23\n3,Z,5.5,\nEnd,\n"
    path.write_text(GOCATOR + raw, encoding="utf-8")
    (line,) = read_scan_lines(path)
    assert np.array_equal(line.y_mm, [0.11, 0.23])
    assert np.array_equal(line.z_mm, [5.5, np.nan], equal_nan=True)
    path.write_text(GOCATOR + "Part,\nFrame,1\nY\\X,0.0,0.1\n0.0,3.5,\n0.5,,4.5\nEnd,\n", encoding="utf-8")
    lines = read_scan_lines(path)
    assert [list(np.isfinite(s.z_mm)) for s in lines] == [[True, False], [False, True]]


def test_lj_x_counts(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.array([[0, 32768, 32769, 40000]], dtype=np.uint16))
    (line,) = read_scan_lines(path, Told("auto", 0.0025, -1.0, unit=40))
    assert np.allclose(line.z_mm[1:], [0.0, 0.0004, (40000 - 32768) * 0.0004], rtol=0, atol=1e-12)
    assert np.isnan(line.z_mm[0])
    with pytest.raises(InputError, match="unit"):
        read_scan_lines(path, Told("auto", 0.0025))
    (tmp_path / "a.toml").write_text("unit = 40\npitch_mm = 0.0025\nstart_mm = -1.0\n")
    assert np.array_equal(read_scan_lines(path)[0].z_mm, line.z_mm, equal_nan=True)
    raw = tmp_path / "a.bin"
    raw.write_bytes(np.array([0, 32769], dtype="<u2").tobytes())
    assert np.isclose(read_scan_lines(raw, Told("keyence_lj_x", 0.1, unit=100, width=2))[0].z_mm[1], 0.001)
    with pytest.raises(InputError, match="width"):
        read_scan_lines(raw, Told("keyence_lj_x", 0.1, unit=100))


def test_lj_v_counts_and_their_marks(tmp_path):
    path = tmp_path / "v.npy"
    marks = [-524288, -524287, -524286, -524285, -(2**31), -(2**31) + 3]
    np.save(path, np.array([*marks, 100000, -250000], dtype=np.int32))
    (line,) = read_scan_lines(path, Told("auto", 0.1, 0.0))
    assert np.all(np.isnan(line.z_mm[:6]))
    assert np.allclose(line.z_mm[6:], [1.0, -2.5], rtol=0, atol=1e-12)


def test_genicam_records_and_columns(tmp_path):
    kinds = [("CoordinateA", "<u2"), ("CoordinateC", "<u2")]
    kinds += [(f"{k}{a}", "<f8") for k in ("Scale", "Offset") for a in "AC"]
    kinds += [("InvalidDataFlagC", "?"), ("InvalidDataValueC", "<f8")]
    rows = np.zeros(3, dtype=kinds)
    rows["CoordinateA"], rows["CoordinateC"] = [0, 10, 20], [100, 0, 300]
    rows["ScaleA"], rows["OffsetA"], rows["ScaleC"], rows["OffsetC"] = 0.1, -5, 0.01, 200
    rows["InvalidDataFlagC"], rows["InvalidDataValueC"] = True, 0
    np.save(tmp_path / "g.npy", rows)
    (tmp_path / "g.csv").write_text(
        "Scan3dCoordinateScale[CoordinateA],0.1\nScan3dCoordinateOffset[CoordinateA],-5\n"
        "Scan3dCoordinateScale[CoordinateC],0.01\nScan3dCoordinateOffset[CoordinateC],200\n"
        "Scan3dInvalidDataFlag[CoordinateC],true\nScan3dInvalidDataValue[CoordinateC],0\n"
        "CoordinateA,CoordinateC\n0,100\n10,0\n20,300\n"
    )
    for name in ("g.npy", "g.csv"):
        (line,) = read_scan_lines(tmp_path / name)
        assert np.allclose(line.y_mm, [-5, -4, -3], rtol=0, atol=1e-12), name
        assert np.allclose(line.z_mm, [201, np.nan, 203], rtol=0, atol=1e-12, equal_nan=True), name


def test_genicam_counts_without_a_scale_are_no_millimetres(tmp_path):
    rows = np.zeros(20, dtype=[("CoordinateA", "<u2"), ("CoordinateC", "<u2")])
    rows["CoordinateA"], rows["CoordinateC"] = 10 * np.arange(20), 19000 + np.arange(20)
    np.save(tmp_path / "g.npy", rows)
    lines = "".join(f"{a},{c}\n" for a, c in rows)
    (tmp_path / "g.csv").write_text("CoordinateA,CoordinateC\n" + lines)
    for name in ("g.npy", "g.csv"):
        with pytest.raises(InputError, match=r"add Scan3dCoordinateScale\[Coordinate[AC]\]"):
            read_scan_lines(tmp_path / name)
    metric = np.zeros(20, dtype=[("CoordinateA", "<f4"), ("CoordinateC", "<f4")])
    metric["CoordinateA"], metric["CoordinateC"] = np.arange(20) / 8, 190 + np.arange(20) / 16
    np.save(tmp_path / "m.npy", metric)
    (line,) = read_scan_lines(tmp_path / "m.npy")
    assert line.z_mm[1] == 190.0625


SICK = """<icon_data_format name="" valuetype="">
 <parameter name="size">12</parameter><parameter name="layout">SUBCOMPONENT</parameter>
 <component name="Range" valuetype="Hi3D"><parameter name="height">2</parameter>
  <genistreamtraits>
   <parameter name="a axis range scale">0.5</parameter><parameter name="a axis range offset">-1</parameter>
   <parameter name="c axis range scale">0.01</parameter><parameter name="c axis range offset">100</parameter>
   <parameter name="c axis range missing">true</parameter><parameter name="c axis range missing value">0</parameter>
   <parameter name="unit">millimeter</parameter>
  </genistreamtraits>
  <subcomponent name="Range" valuetype="WORD"><parameter name="width">3</parameter></subcomponent>
  <subcomponent name="Intensity" valuetype="BYTE"><parameter name="width">3</parameter></subcomponent>
 </component>
</icon_data_format>"""


def test_sick_buffers_by_either_of_their_files(tmp_path):
    (tmp_path / "s.xml").write_text(SICK)
    data = np.array([[1000, 0, 2000], [0, 1, 2]], dtype="<u2").tobytes() + bytes(range(6))
    (tmp_path / "s.dat").write_bytes(data)
    for name in ("s.xml", "s.dat"):
        first, second = read_scan_lines(tmp_path / name)
        assert np.allclose(first.y_mm, [-1.0, -0.5, 0.0], rtol=0, atol=1e-12)
        assert np.allclose(first.z_mm, [110, np.nan, 120], rtol=0, atol=1e-12, equal_nan=True)
        assert np.array_equal(second.intensity, [3, 4, 5])
    (tmp_path / "s.dat").write_bytes(data[:-1])
    with pytest.raises(InputError, match="announces more"):
        read_scan_lines(tmp_path / "s.xml")
    bomb = '<!DOCTYPE a [<!ENTITY b "bbbb"><!ENTITY c "&b;&b;&b;">]>' + SICK
    (tmp_path / "s.xml").write_text(bomb)
    with pytest.raises(InputError, match="entities"):
        read_scan_lines(tmp_path / "s.xml")


def test_wenglor_points_without_light_are_missing(tmp_path):
    path = tmp_path / "w.csv"
    path.write_text("x;z;intensity;peak width\n-1,5;210,25;800;5\n0;0;0;0\n1,5;211,0;790;6\n", encoding="utf-8")
    (line,) = read_scan_lines(path)
    assert np.array_equal(line.z_mm, [210.25, np.nan, 211.0], equal_nan=True)
    assert np.array_equal(line.intensity, [800, 0, 790])


def test_wenglor_columns_without_a_header_are_known_by_their_dark_points(tmp_path):
    path = tmp_path / "w.csv"
    path.write_text("-1.5;210.25;800;5\n0;0;0;0\n-0.5;210.5;790;6\n0.5;211;790;6\n")
    (line,) = read_scan_lines(path)
    assert np.array_equal(line.y_mm, [-1.5, np.nan, -0.5, 0.5], equal_nan=True)
    assert np.array_equal(line.intensity, [800, 0, 790, 790])


def test_a_header_of_unknown_columns_is_repeated_with_what_would_be_right(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("X,Z\n-1.5,210.25\n")
    with pytest.raises(InputError, match=r'its first line, "X,Z", names no columns.*y_mm \(or x_mm'):
        read_scan_lines(path)


def test_an_excel_workbook_is_called_so(tmp_path):
    path = tmp_path / "p.csv"
    path.write_bytes(b"PK\x03\x04" + bytes(range(256)) * 4)
    with pytest.raises(InputError, match="is an Excel workbook or another archive, no profile: save the sheet as CSV"):
        read_scan_lines(path)


def test_opencv_yaml_as_filestorage_writes_it(tmp_path):
    cv2 = pytest.importorskip("cv2")
    path = tmp_path / "p.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("scan_line", np.array([[1.5, 0.0, -16.25], [1.75, 0.0, -16.5]]))
    storage.release()
    text = path.read_text()
    if "[" not in text.split("scan_line")[1].split(":")[1]:
        assert "data" in text  # a matrix
    (line,) = read_scan_lines(path)
    assert np.array_equal(line.y_mm, [1.5, 1.75])
    assert np.array_equal(line.z_mm, [-16.25, -16.5])


PCD = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 3\nHEIGHT 1\n"


def test_pcd_ascii_binary_and_compressed(tmp_path):
    points = np.array([[1.5, 0, 7.25, 9], [2.5, 0, np.nan, 0], [3.5, 0, 7.75, 8]], dtype="<f4")
    plain = points.T.tobytes()
    packed = b"".join(bytes([len(plain[i : i + 32]) - 1]) + plain[i : i + 32] for i in range(0, len(plain), 32))
    rows = "\n".join(" ".join(map(str, row)) for row in points.tolist()) + "\n"
    bodies = {
        "ascii": rows.encode(),
        "binary": points.tobytes(),
        "binary_compressed": struct.pack("<II", len(packed), len(plain)) + packed,
    }
    for form, body in bodies.items():
        path = tmp_path / f"{form}.pcd"
        path.write_bytes((PCD + f"POINTS 3\nDATA {form}\n").encode() + body)
        (line,) = read_scan_lines(path)
        assert np.array_equal(line.y_mm, [1.5, 2.5, 3.5]), form
        assert np.array_equal(line.z_mm, [7.25, np.nan, 7.75], equal_nan=True), form


def test_lzf_copies_may_overlap_what_they_write(tmp_path):
    """Sixteen equal bytes: one literal, then a copy of fifteen from one byte before (length 7 + 6, and 2)."""
    header = PCD.replace(" intensity", "").replace(" 4 4 4 4", " 4 4 4").replace(" F F F F", " F F F")
    header = header.replace(" 1 1 1 1", " 1 1 1").replace("WIDTH 3", "WIDTH 1")
    packed = bytes([0, 0, (7 << 5) | 0, 2, 0])  # a zero; then 7 + 2 + 2 = 11 copies of it
    body = struct.pack("<II", len(packed), 12) + packed
    path = tmp_path / "c.pcd"
    path.write_bytes((header + "POINTS 1\nDATA binary_compressed\n").encode() + body)
    (line,) = read_scan_lines(path)
    assert np.array_equal(line.z_mm, [0.0])


def test_ply_binary_of_a_maker_with_y_the_travel(tmp_path):
    head = "ply\nformat binary_big_endian 1.0\nelement vertex 6\n"
    head += "".join(f"property float {c}\n" for c in "xyz") + "end_header\n"
    points = np.array([[k, t, 10 * t + k] for t in (0.0, 0.5) for k in (1.0, 2.0, 3.0)], dtype=">f4")
    path = tmp_path / "a.ply"
    path.write_bytes(head.encode() + points.tobytes())
    first, second = read_scan_lines(path)
    assert np.array_equal(first.y_mm, [1, 2, 3])
    assert np.array_equal(second.z_mm, [6, 7, 8])


def test_a_scattered_cloud_is_no_profile(tmp_path):
    path = tmp_path / "c.xyz"
    np.savetxt(path, np.random.default_rng(0).normal(size=(50, 3)))
    with pytest.raises(InputError, match="constant along a profile"):
        read_scan_lines(path)


def test_csv_of_many_profiles_and_the_makers_name_of_the_lateral_axis(tmp_path):
    path = tmp_path / "c.csv"
    path.write_text("profile,x_mm,z_mm,intensity\n4,0.5,7.5,1\n4,1.5,nan,2\n9,0.5,8.5,3\n")
    first, second = read_scan_lines(path)
    assert (first.number, second.number) == (4, 9)
    assert np.array_equal(first.z_mm, [7.5, np.nan], equal_nan=True)
    path.write_text("x_m,z_m\n0.5,7.5\n")
    with pytest.raises(InputError, match="x_mm"):
        read_scan_lines(path)


def test_arrays_of_objects_are_never_unpickled(tmp_path):
    path = tmp_path / "o.npy"
    np.save(path, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(InputError):
        read_scan_lines(path)


def test_convert_names_what_is_missing_and_refuses_its_own_input(tmp_path):
    path = tmp_path / "a.csv"
    write_scan_lines(path, (example(),), Told("csv"))
    with pytest.raises(InputError, match="input itself"):
        convert(path, path)
    with pytest.raises(InputError, match="did you mean"):
        convert(path, tmp_path / "b.csv", "gocater")
    with pytest.raises(InputError, match="tells no format"):
        convert(path, tmp_path / "b.dat")
    assert "missing" in convert(path, tmp_path / "b.npy")
    convert(path, tmp_path / "c.npy", "keyence_lj_x", pitch_mm=PITCH_MM)
    back = read_scan_lines(tmp_path / "c.npy")[0]
    assert np.allclose(back.y_mm, example().y_mm, rtol=0, atol=1e-9)
    assert np.allclose(back.z_mm, example().z_mm, rtol=0, atol=0.006, equal_nan=True)


def test_points_off_the_grid_are_interpolated_between_neighbours_and_never_across_gaps(tmp_path):
    y = np.concatenate([np.arange(0.03, 5.0, 0.07), np.arange(8.0, 12.0, 0.07)])
    path = tmp_path / "k.csv"
    write_scan_lines(path, (ScanLine(y, 0.5 * y),), Told("keyence_csv", 0.1, 0.0))
    (line,) = read_scan_lines(path, Told("keyence_csv", 0.1, 0.0))
    there = line.present
    assert np.allclose(line.z_mm[there], 0.5 * line.y_mm[there], rtol=0, atol=1e-4)
    assert not np.any(there[(line.y_mm > 5.05) & (line.y_mm < 7.95)])
    assert np.count_nonzero(there) > 80
