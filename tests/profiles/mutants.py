"""Profile files spoilt at random: bytes flipped, cut, doubled, numbers blown up, words swapped."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from workbench.profiles import SUFFIXES, WRITERS, ScanLine, Told, write_scan_lines

WORDS = [
    b"nan", b"-1", b"1e308", b"99999999999999999999", b"", b",", b";", b"\0", b"\n", b"\r", b"\t", b"[", b"]", b"End",
    b"Z", b"Axis", b"-999.9999", b"vertex", b"float", b"0", b"\xff\xfe", b"\xef\xbb\xbf", b"'", b'"', b"(", b"{",
    b"inf", b"property list uchar int x", b"COUNT 9", b"<a>", b"&b;", b"1_0", b"\xc2\xb5",
]  # fmt: skip


def samples(folder: Path) -> list[Path]:
    """A file of every format that can be written, and the ones that only makers write."""
    y = np.arange(-4, 4, 0.25)
    lines = tuple(ScanLine(y, np.where(np.abs(y) < 0.4, np.nan, 20 + y / 7 + k), number=k) for k in range(2))
    out = []
    for name in WRITERS:
        path = folder / f"{name}{SUFFIXES[name]}"
        write_scan_lines(path, lines, Told(name, 0.25, -4.0, unit=1000 if name == "keyence_lj_x" else None))
        out.append(path)
    np.save(folder / "lj_v.npy", np.arange(40, dtype=np.int32))
    records = np.zeros(9, dtype=[("CoordinateA", "<u2"), ("CoordinateC", "<u2"), ("ScaleC", "<f8")])
    records["CoordinateC"], records["ScaleC"] = 7, 0.5
    np.save(folder / "genicam.npy", records)
    (folder / "genicam.csv").write_text("ScaleC,0.5\nOffsetC,3\nCoordinateA,CoordinateC\n1,2\n2,3\n3,4\n")
    (folder / "wenglor.csv").write_text("x;z;intensity;peak width\n1,5;2;3;4\n0;0;0;0\n2,5;2;3;4\n")
    pcd = "# .PCD v0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 1\nPOINTS 4\n"
    points = np.column_stack([np.arange(4), np.zeros(4), np.arange(4)]).astype("<f4")
    (folder / "a.pcd").write_text(pcd + "DATA ascii\n" + "\n".join(" ".join(map(str, p)) for p in points.tolist()))
    (folder / "b.pcd").write_bytes((pcd + "DATA binary\n").encode() + points.tobytes())
    packed = bytes([31]) + points.tobytes()[:32] + bytes([15]) + points.tobytes()[32:]
    sizes = len(packed).to_bytes(4, "little") + (48).to_bytes(4, "little")
    (folder / "c.pcd").write_bytes((pcd + "DATA binary_compressed\n").encode() + sizes + packed)
    ply = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    )
    (folder / "b.ply").write_bytes((ply + "end_header\n").encode() + points.tobytes())
    sick = (
        '<icon_data_format><parameter name="layout">SUBCOMPONENT</parameter><component name="R">'
        '<parameter name="height">2</parameter><genistreamtraits><parameter name="c axis range scale">0.01</parameter>'
        '<parameter name="a axis range scale">0.1</parameter></genistreamtraits><subcomponent name="Range" '
        'valuetype="WORD"><parameter name="width">3</parameter></subcomponent></component></icon_data_format>'
    )
    (folder / "s.xml").write_text(sick)
    (folder / "s.dat").write_bytes(np.arange(6, dtype="<u2").tobytes())
    named = (
        "lj_v.npy",
        "genicam.npy",
        "genicam.csv",
        "wenglor.csv",
        "a.pcd",
        "b.pcd",
        "c.pcd",
        "b.ply",
        "s.xml",
        "s.dat",
    )
    return out + [folder / name for name in named]


def mutants(data: bytes, rng: np.random.Generator, count: int) -> Iterator[bytes]:
    """Spoilt copies of a file's bytes."""
    for _ in range(count):
        spoilt = bytearray(data)
        for _ in range(int(rng.integers(1, 4))):
            at = int(rng.integers(0, max(1, len(spoilt))))
            # headers decide most: look there half of the time
            at = at if rng.random() < 0.5 else int(rng.integers(0, max(1, min(len(spoilt), 300))))
            kind = int(rng.integers(0, 6))
            span = int(rng.integers(1, 12))
            if kind == 0 and spoilt:
                spoilt[at] ^= 1 << int(rng.integers(0, 8))
            elif kind == 1:
                del spoilt[at:]
            elif kind == 2:
                del spoilt[at : at + span]
            elif kind == 3:
                spoilt[at:at] = spoilt[at : at + 4 * span]
            else:
                spoilt[at : at + (span if kind == 4 else 0)] = WORDS[int(rng.integers(0, len(WORDS)))]
        yield bytes(spoilt)
