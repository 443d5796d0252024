"""Faults on bad files: mutations of every format, kills at random moments, and machines that are full, locked or small.

A fault is anything but an answer or one sentence: another exception, a sentence of several lines, no end within the
patience, a result that differs after a kill, a file that is neither whole nor absent. Prints counts and every fault's
seed; the exit code is 1 where there is one. Mutations: bytes flipped, set, cut, doubled, moved and filled, words
replaced by numbers and words that programs stumble over; a file may be hit several times.
Run: PYTHONPATH=. python benchmarks/bad_files.py [mutations, default 5000] [kills, default 30] [seed]; a release takes
200000 500.
"""

from __future__ import annotations

import contextlib
import io
import json
import logging
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import trimesh
from bad_moments import corner, kill, undisturbed

import assets
from extraction import read_profile_csv
from geometry import InputError, NoAnswerError
from jig_cad import read_jig
from perceptron_emu import read_scene
from perceptron_emu.mesh_file import read_mesh
from tests.profiles.mutants import samples
from tests.workbench.image_files import levels_of, packed_rows, png_with, sensor_of, tiff
from workbench.accept import accept_gauge, accept_repeat, read_series
from workbench.campaign import read_plan
from workbench.cli.main import run
from workbench.files import (
    find_views,
    lay_onto,
    read_board,
    read_cell,
    read_emulator,
    read_image,
    read_points,
    read_result,
    read_robot,
    read_sensor,
    read_settings,
    read_sockets,
    read_target,
    read_truth,
)
from workbench.files.robots.urdf import read_urdf
from workbench.profiles import read_scan_lines, write_scan_lines
from workbench.profiles.scan_line import ScanLine, Told
from workbench.validate import read_thresholds

PATIENCE_S = 30.0  # of the wall's time: a busy machine is no fault
USED = 0.06  # share of the mutated files that, read, are worked with
MEMORY_BYTES = 6 * 2**30  # of address space: what a mutation makes a reader ask for beyond it is a MemoryError
WORDS = (
    b"nan", b"inf", b"-inf", b"1e300", b"-1e308", b"1e-320", b"0", b"-0.0", b"-1", b"9" * 400, b"1e", b"0x", b"true",
    b"99999999999", b"2147483648", b"4294967295", b"-32768", b"", b" ", b"\n", b"\r", b"\t", b";", b",", b'"', b"'",
    b"[", b"]", b"{", b"}", b"[[", b"=", b"#", b"\\", b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", "°σ→".encode(), b"../../x",
    b"/dev/zero", b"%s%n", b"<!--", b"<", b"&lol;", b"name", b"1.2.3", b"1,5", b"-9999", b"[" * 3000,
    b"a." * 5000 + b"a = 1\n", b"\xc3", b"x" * 3000,
)  # fmt: skip


@dataclass(frozen=True)
class Format:
    """A good file, what reads it, and what does the work with it where it could be read."""

    name: str
    file: str
    read: Callable[[Path], object]
    use: Callable[[Path], object] | None = None
    said: list[str] = field(default_factory=list)


def main() -> None:
    """Run all parts and print their counts."""
    mutations, kills, seed = ([int(a) for a in sys.argv[1:4]] + [5000, 30, 0][len(sys.argv[1:4]) :])[:3]
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        faults += mutate(Path(folder), mutations, seed)
        if kills:
            known = undisturbed(Path(folder))
            faults += known.faults + kill(known, kills, seed) + corner(known)
    for fault in faults:
        print("FAULT", fault)
    print(f"{len(faults)} faults")
    sys.exit(1 if faults else 0)


def mutate(folder: Path, count: int, seed: int) -> list[str]:
    """Mutate each format's file in turn; a reader has to answer or to say one sentence, and so has what uses it."""
    formats = good_files(folder)
    counts: Counter[tuple[str, str]] = Counter()
    faults: list[str] = []
    quiet = logging.getLogger("trimesh")
    quiet.setLevel(logging.CRITICAL)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, resource.RLIM_INFINITY))
    signal.signal(signal.SIGALRM, _too_long)
    start = time.process_time()
    for form in formats:
        found = [_outcome(form, read, folder / form.file) for read in (form.read, form.use) if read is not None]
        faults += [f"{form.name}: the good file: {o}: {' '.join(form.said)}" for o in found if o != "read"]
    for i in range(count):
        form = formats[i % len(formats)]
        path = folder / form.file
        good = path.read_bytes()
        rng = np.random.default_rng([seed, i])
        path.write_bytes(mutated(good, rng))
        outcome, what = _outcome(form, form.read, path), ""
        if outcome == "read" and form.use is not None and rng.random() < USED:
            outcome, what = _outcome(form, form.use, path), ", used"
            counts[form.name, "used"] += 1
        if outcome not in ("read", "a sentence"):
            faults.append(f"{form.name}{what}, seed {seed}, mutation {i}: {outcome}")
            print(" ", faults[-1], flush=True)
            shutil.copy(path, Path(tempfile.gettempdir()) / f"bad_files_{seed}_{i}{path.suffix}")
        counts[form.name, outcome if outcome in ("read", "a sentence") else "fault"] += 1
        path.write_bytes(good)
        if i % 20000 == 19999:
            print(f"  {i + 1} of {count} mutations, {time.process_time() - start:.0f} s", flush=True)
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    print(f"{count} mutations of {len(formats)} formats in {time.process_time() - start:.0f} s of one core")
    for form in formats:
        shown = ", ".join(f"{counts[form.name, o]} {o}" for o in ("read", "a sentence", "fault", "used"))
        print(f"  {form.name:24s} {shown}")
    total = {o: sum(n for (_, what), n in counts.items() if what == o) for o in ("read", "a sentence", "fault", "used")}
    print("  in all: " + ", ".join(f"{n} {o}" for o, n in total.items()), flush=True)
    return faults


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """One to three injuries."""
    out = bytearray(data)
    text = b"\0" not in data[:500] and rng.random() < 0.8  # mostly stays text, or nothing else would be met
    low, high = (32, 127) if text else (0, 256)
    for _ in range(int(rng.choice((1, 1, 1, 2, 3)))):
        n = len(out)
        at, other = (int(v) for v in rng.integers(0, max(n, 1), 2))
        what = rng.integers(0, 10)
        if what == 0 and n:
            out[at] ^= 1 << int(rng.integers(5 if text else 8))
        elif what == 1 and n:
            out[at] = int(rng.integers(low, high))
        elif what == 2:
            del out[at:]
        elif what == 3:
            del out[min(at, other) : max(at, other)][: int(rng.integers(1, 2000))]
        elif what == 4:
            out[at:at] = out[at : at + int(rng.integers(1, 200))]
        elif what == 5:
            lines = bytes(out).split(b"\n")
            rng.shuffle(lines)  # type: ignore[arg-type]
            out = bytearray(b"\n".join(lines))
        elif what == 6:
            out[at : at + 4] = bytes(rng.integers(low, high, 4, dtype=np.uint8))
        else:
            words = [m.span() for m in re.finditer(rb"[\w.+\-\"]+", bytes(out[:200_000]))]
            start, end = words[int(rng.integers(len(words)))] if words else (at, at)
            out[start:end] = WORDS[int(rng.integers(len(WORDS)))]
    return bytes(out)


def _outcome(form: Format, read: Callable[[Path], object], path: Path) -> str:
    said = io.StringIO()
    signal.setitimer(signal.ITIMER_REAL, PATIENCE_S)
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            read(path)
        outcome = "read"
    except (InputError, NoAnswerError) as error:
        text = str(error)
        form.said.append(text)
        outcome = "a sentence" if "\n" not in text and 0 < len(text) < 1500 else f"no sentence: {text[:300]!r}"
    except MemoryError:
        outcome = "a sentence"  # the command line says it: not enough memory
    except BaseException as error:  # noqa: BLE001 - that is what is looked for
        outcome = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    return outcome


def command(*words: str | Path) -> None:
    """Run a command in this process: InputError where it ends in a sentence, RuntimeError where in anything else."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        code = run([str(w) for w in words])
    text = said.getvalue()
    if code not in (0, 1, 2, 3) or "Traceback" in text:
        raise RuntimeError(f"exit code {code}: {text[-300:]}")
    if code == 2:
        raise InputError("".join(line for line in text.splitlines() if "error:" in line) or "said in its table")


def _too_long(*_: object) -> None:
    raise TimeoutError(f"no end within {PATIENCE_S:.0f} s")


def good_files(folder: Path) -> list[Format]:
    """A file of every format, of small size, and what reads it."""
    sample = folder / "cell"
    shutil.copytree(assets.path("samples", "cell_a"), sample)
    with contextlib.redirect_stdout(io.StringIO()):
        run(["extract", str(sample), "--csv", str(sample / "points.csv")])
    cell = read_cell(sample)
    sensor = cell.sensor
    picture = sample / cell.frames[0].image
    small = folder / "small.toml"
    text = (sample / "sensor.toml").read_text()
    small.write_text(re.sub(r"(?m)^(width|height|fx|fy|cx|cy)_px *= *([\d.]+)", _half, text))
    pictures = _pictures(folder)
    box = trimesh.creation.box((40, 30, 20))
    for suffix in ("stl", "obj", "ply", "glb"):
        (box.copy().apply_scale(0.001) if suffix == "glb" else box).export(folder / f"a.{suffix}")
    (folder / "arm.urdf").write_text(_URDF)
    (folder / "arm.toml").write_text('urdf = "arm.urdf"\nbase = "a"\ntip = "c"\n')
    (folder / "plan.toml").write_text(_PLAN)
    (folder / "settings.toml").write_text(
        "[detect]\nthreshold = 5.0\n[calib]\nmodel = 'scp'\n[localise]\nmethod = 'ml'\n"
    )
    (folder / "stripe.toml").write_text("[stripe]\nmin_snr = 5.0\n[gapflush]\nmin_gap_mm = 0.5\n")
    (folder / "scene.toml").write_text(
        "[[mesh]]\nfile = 'a.stl'\nmaterial = 'aluminium'\nrotation_deg = [10, 20, 30]\ntranslation_mm = [0, 0, 300]\n"
    )
    (folder / "truth.json").write_text(_truth(cell))
    y = np.linspace(-20, 20, 60)
    told = Told(pitch_mm=float(y[1] - y[0]), start_mm=-20.0)
    line = ScanLine(y, 250 + np.abs(y) / 4)
    forms = [
        Format("cell.toml", "cell/cell.toml", read_cell, solve),
        Format("frames.csv", "cell/frames.csv", lambda p: read_cell(p.parent), solve),
        Format("points.csv", "cell/points.csv", lambda p: read_points(p, cell.jig.strings), solve),
        Format(
            "sensor.toml", "cell/sensor.toml", lambda p: (read_sensor(p), read_emulator(p)), lambda p: see(p, picture)
        ),
        Format("robot.toml", "cell/robot.toml", read_robot, solve),
        Format("jig.toml", "cell/jig.toml", read_jig, solve),
        Format("urdf", "arm.urdf", lambda p: read_urdf(p, "a", "c"), lambda p: move(p.with_suffix(".toml"))),
        Format("robot.toml of a urdf", "arm.toml", read_robot, move),
        Format("truth.json", "truth.json", read_truth),
        Format("settings", "settings.toml", lambda p: read_settings([p]), lambda p: look(picture, "--config", p)),
        Format(
            "settings of stripes",
            "stripe.toml",
            lambda p: read_settings([p]),
            lambda p: see(sample / "sensor.toml", picture, p),
        ),
        Format("plan", "plan.toml", read_plan),
        Format("scene", "scene.toml", lambda p: read_scene(p, sensor), show),
        *(Format(s, f"a.{s}", read_mesh, lambda p: show(p.parent / "scene.toml")) for s in ("stl",)),
        *(Format(s, f"a.{s}", read_mesh) for s in ("obj", "ply", "glb")),
        *pictures,
    ]
    for kind in ("csv", "gocator", "keyence_csv", "ply", "npy"):
        name = f"profile_{kind}.{kind if kind in ('npy', 'ply') else 'csv'}"
        write_scan_lines(folder / name, [line], replace(told, format=kind))
        forms.append(Format(f"profile {kind}", name, lambda p: read_scan_lines(p, told), change))
    forms.append(Format("profile csv, stripes", "profile_csv.csv", read_profile_csv, gaps))
    study = [f"{i},{o},{t},{i + 0.1 * t + 0.3 * (o == 'B'):.2f}" for i in range(4) for o in "AB" for t in (1, 2)]
    (folder / "study.csv").write_text("part,operator,trial,value\n" + "\n".join(study) + "\n")
    forms += _more(folder)
    forms.append(
        Format(
            "gauge study", "study.csv", lambda p: accept_gauge(p, tolerance_mm=1.0),
            lambda p: command("accept", "gauge", p, "--tolerance-mm", "1", "--report", p.with_suffix(".html")),
        )
    )  # fmt: skip
    forms.append(
        Format("series of a master", "study.csv", lambda p: accept_repeat([read_series(p)], [p], tolerance=1.0))
    )
    return forms


# of a picture as stored: one tag, Orientation = 1
_EXIF = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x01\0\0\0\0\0\0"


def _pictures(folder: Path) -> list[Format]:
    """Images of a small sensor as cameras and tools write them."""
    bits12, bits16 = packed_rows(levels_of(12, 0.9), 12), levels_of(16).astype("<u2").tobytes()
    small = {
        "a.png": png_with(levels_of(8)),
        "sbit.png": png_with(levels_of(12) << 4, (b"sBIT", b"\x0c")),
        "exif.png": png_with(levels_of(8), (b"eXIf", _EXIF)),
        "packed.tif": tiff(bits12, 12),
        "other_way.tif": tiff(levels_of(16).astype(">u2").tobytes(), 16, ">"),
        "turned.tif": tiff(bits16, 16, t274=1),
        "white_is_zero.tif": tiff(bits16, 16, t262=0),
        "signed.tif": tiff(levels_of(14).tobytes(), 16, t339=2),
        "a.bmp": cv2.imencode(".bmp", levels_of(8))[1].tobytes(),
        "a.jpg": cv2.imencode(".jpg", levels_of(8))[1].tobytes(),
    }  # fmt: skip
    for name, code in (("lzw", 5), ("deflate", 8), ("packbits", 32773)):
        small[f"{name}.tif"] = cv2.imencode(".tif", levels_of(8), [cv2.IMWRITE_TIFF_COMPRESSION, code])[1].tobytes()
    deep = {"sbit.png": 12, "packed.tif": 12} | dict.fromkeys(("other_way.tif", "turned.tif", "white_is_zero.tif"), 16)
    out = []
    for name, data in small.items():
        (folder / name).write_bytes(data)
        sensor = sensor_of(deep.get(name, 14 if name == "signed.tif" else 8))
        out.append(
            Format(
                name, name, lambda p, s=sensor: read_image(p, s, lossy=True), lambda p: command("profile", p, "--json")
            )  # type: ignore[misc]
        )
    return out


def solve(path: Path) -> None:
    """Calibrate the cell of a file."""
    command("calibrate", path.parent, "--model", "scp", "--json")


def examine(path: Path) -> None:
    """Look the cell of a file through."""
    command("doctor", path.parent)


def see(sensor: Path, picture: Path, *recipe: Path) -> None:
    """Measure a stripe in millimetres."""
    command("profile", picture, "--sensor", sensor, "--json", *(w for r in recipe for w in ("--recipe", r)))


def look(picture: Path, *words: str | Path) -> None:
    """Look for spots in one image."""
    sample = picture.parent.parent
    command("extract", picture, "--sensor", sample / "sensor.toml", "--jig", sample / "jig.toml", "--json", *words)


def show(path: Path) -> None:
    """Render a scene."""
    command("render", path, "--sensor", path.parent / "small.toml", "--out", path.parent / "shown")


def change(path: Path) -> None:
    """Convert a profile file."""
    command("convert", path, path.parent / "converted.csv", "--pitch-mm", "0.25", "--start-mm", "-4", "--unit", "1000")


def gaps(path: Path, *recipe: Path) -> None:
    """Measure gap and flush."""
    command("gapflush", path, "--json", *(w for r in recipe for w in ("--recipe", r)))


def draw(path: Path) -> None:
    """Draw a target for the workshop."""
    command("jig", path, "--export", path.parent / "drawn.svg", "--export", path.parent / "drawn.dxf")


def compare(path: Path) -> None:
    """Compare a result with its like."""
    command("compare", path, path.parent / "first.json", "--json")


def move(path: Path) -> None:
    """Poses of a robot and how they change with its parameters."""
    robot = read_robot(path)
    q = np.full((3, robot.n_joints), 0.3)
    robot.pose(q)


def _more(folder: Path) -> list[Format]:
    """Files that a cell, a sensor's calibration or a check may have beside the usual ones."""
    sample = folder / "cell"
    full = folder / "full"
    shutil.copytree(sample, full)
    (full / "cell.toml").write_text((full / "cell.toml").read_text() + _CELL)
    axes = ",".join(f"j{k}_deg" for k in range(1, 7))
    readings = [",".join(f"{10 * np.sin(r + 2 * k):.3f}" for k in range(6)) for r in range(8)]
    positions = [f"p{r % 2},{1500 + 3 * r},{20 * r},{700 - r}" for r in range(8)]
    (full / "tracker.csv").write_text(f"point,x_mm,y_mm,z_mm,{axes}\n" + _joined(positions, readings))
    (full / "sockets.csv").write_text(f"socket,{axes}\n" + _joined([f"s{r % 2}" for r in range(8)], readings))
    poses = folder / "poses"
    shutil.copytree(sample, poses)
    (poses / "robot.toml").unlink()
    (poses / "points.csv").unlink()
    text = re.sub(r"(?m)^robot *=.*$", "", (poses / "cell.toml").read_text())
    (poses / "cell.toml").write_text(text + '\n[poses]\nconvention = "fanuc"\ntool = [0, 0, 0, 0, 0, 0]\n')
    names = [f"images/{path.name}" for path in sorted((poses / "images").iterdir())]
    rows = [f"{k};{names[k]};A;calibrate;1200,5;-3{k},25;80{k};17{k},5;2,25;-91,5;N U T, 0, 0, 0" for k in range(6)]
    (poses / "frames.csv").write_bytes(
        ("frame;image;location;role;X;Y;Z;W;P;R;config;;\r\n" + "\r\n".join(rows)).encode("utf-8-sig")
    )
    with contextlib.redirect_stdout(io.StringIO()) as said:
        run(["calibrate", str(sample), "--json"])
    (folder / "result.json").write_text(said.getvalue())
    (folder / "first.json").write_text(said.getvalue())
    (folder / "recipe.toml").write_text(_RECIPE)
    (folder / "board.toml").write_text('kind = "checkerboard"\ncorners = [9, 6]\nsquare_mm = 12.5\n')
    (folder / "charuco.toml").write_text(
        'kind = "charuco"\nsquares = [9, 6]\nsquare_mm = 12.5\nmarker_mm = 9.0\ndictionary = "DICT_4X4_50"\n'
    )
    views = folder / "views"
    views.mkdir()
    (views / "views.csv").write_text("view,board,stripe\n1,1_off.png,1_on.png\n2,2.png,2.png\n3,3_off.png,\n")
    balls = "".join(
        f"[[ball]]\nname = 'b{k}'\ndiameter_mm = 30.0\ncentre_mm = [{80 * k}, {9 * k * k}, 0.0]\n" for k in range(3)
    )
    (folder / "balls.toml").write_text('kind = "balls"\n' + balls)
    (folder / "wedge.toml").write_text('kind = "wedge"\nangle_deg = 90.0\n')
    (folder / "lines.toml").write_text(
        'kind = "strings"\nstring_diameter_mm = 0.3\ntolerance_mm = 0.1\n[anchors_mm]\n'
        "p = [0, 0, 0]\nq = [100, 5, 0]\nr = [0, 80, 9]\n"
        's = [100, 80, 40]\n[strings]\none = ["p", "q"]\ntwo = ["r", "s"]\nthree = ["p", "s"]\n'
    )
    jig = read_jig(sample / "jig.toml")
    (folder / "cmm.csv").write_text(
        "name;x_mm;y_mm;z_mm;diameter_mm\nb0;1,5;2;3;29,98\nb1;81,5;11;3;29,99\nb2;161,5;38;3;30,01\n"
    )
    places = [f"{n},{','.join(f'{v + 7:.3f}' for v in p)}" for n, p in zip(jig.anchors, jig.anchors_mm, strict=True)]
    (folder / "anchors.csv").write_text("name,x_mm,y_mm,z_mm\n" + "\n".join(places) + "\n")
    (folder / "load.toml").write_text((sample / "robot.toml").read_text() + "\n[compliance]\npayload_kg = 12.0\n")
    (folder / "thresholds.toml").write_text("min_detection_rate = 0.9\n")
    (folder / "joints.csv").write_text("\n".join(readings) + "\n")
    out = [
        Format("cell.toml with all", "full/cell.toml", read_cell, solve),
        Format("tracker.csv", "full/tracker.csv", lambda p: read_cell(p.parent), solve),
        Format("sockets.csv", "full/sockets.csv", lambda p: read_cell(p.parent), solve),
        Format("cell.toml of poses", "poses/cell.toml", read_cell, examine),
        Format("frames.csv of poses", "poses/frames.csv", lambda p: read_cell(p.parent), examine),
        Format("result.json", "result.json", read_result, compare),
        Format("recipe", "recipe.toml", lambda p: read_settings([p]), lambda p: gaps(folder / "profile_csv.csv", p)),
        Format("board.toml", "board.toml", read_board),
        Format("board.toml, ChArUco", "charuco.toml", read_board),
        Format("views.csv", "views/views.csv", lambda p: find_views(p.parent)),
        Format("target.toml, balls", "balls.toml", read_target, draw),
        Format("target.toml, wedge", "wedge.toml", read_target, draw),
        Format("target.toml, lines", "lines.toml", read_target),
        Format("anchors of a jig", "anchors.csv", lambda p: lay_onto(jig, p)),
        Format("balls as measured", "cmm.csv", lambda p: lay_onto(read_target(p.parent / "balls.toml"), p)),
        Format("robot.toml with load", "load.toml", read_robot, move),
        Format("thresholds", "thresholds.toml", read_thresholds),
        Format("joints of sockets", "joints.csv", lambda p: read_sockets([p], 6, degrees=True)),
    ]
    makers = folder / "makers"
    makers.mkdir()
    told = Told(pitch_mm=0.25, start_mm=-4.0, unit=1000)
    named = (f for f in samples(makers) if f.suffix != ".xml" and f.name != "c.pcd")  # a cloud, no profile
    return out + [
        Format(f"profile {f.name}", f"makers/{f.name}", lambda p: read_scan_lines(p, told), change) for f in named
    ]


def _half(key: re.Match[str]) -> str:
    value = float(key[2]) / 4
    return f"{key[1]}_px = {value if key[1][0] in 'fc' else int(value)}"


def _joined(heads: list[str], tails: list[str]) -> str:
    return "\n".join(f"{head},{tail}" for head, tail in zip(heads, tails, strict=True)) + "\n"


_CELL = """
[workspace]
floor_z_mm = -20.0
[[workspace.box]]
min_mm = [2000.0, -500.0, 0.0]
max_mm = [2600.0, 500.0, 900.0]
[evidence]
tracker = "tracker.csv"
tracker_sigma_mm = 0.05
sockets = "sockets.csv"
[[evidence.distance]]
between = ["A", "B"]
distance_mm = 900.0
sigma_mm = 0.1
"""
_RECIPE = """what = "stripe"
[region]
keep = [[[10, 10], [600, 10], [600, 400]]]
[stripe]
min_snr = 5.0
[measure]
feature = "sphere"
diameter_mm = 40.0
[tolerances.radius_mm]
min = 19.9
max = 20.1
[gapflush]
definition = "tangent"
"""
_URDF = (
    '<?xml version="1.0"?>\n<robot name="r"><link name="a"/><link name="b"/><link name="c"/>\n'
    '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.1 0 0.3" rpy="0 1.5707963 0"/>'
    '<axis xyz="0 0 1"/><limit lower="-3" upper="3"/></joint>\n'
    '<joint name="k" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>'
    "</joint></robot>\n"
)
_PLAN = """seed = 3
run = "extract"
design = "random"
samples = 4
[base.jig]
side_mm = 90.0
[factors]
"jig.string_diameter_mm" = { low = 0.2, high = 0.5 }
"emulator.noise.read_noise_e" = [10.0, 20.0]
"""


def _truth(cell: object) -> str:
    point = {
        "label": "A",
        "axis_mm": [1.0, 2.0],
        "surface_mm": [1.0, 2.0],
        "image_px": [3.0, 4.0],
        "visible_fraction": 1.0,
    }
    eye = np.eye(4).tolist()
    return json.dumps(
        {
            "name": "recipe",
            "T_hand_sensor": eye,
            "dh": [{"theta_offset_deg": 0, "d_mm": 1, "a_mm": 2, "alpha_deg": 90, "beta_deg": 0}],
            "anchors_mm": {"Ab": [0, 0, 0]},
            "locations": {"A": eye},
            "frames": [{"frame": 0, "T_sensor_jig": eye, "points": [point]}],
        }
    )


if __name__ == "__main__":
    main()
