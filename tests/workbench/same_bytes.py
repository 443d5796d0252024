"""The same commands in other numeric environments, and the digests of what they write.

As a script it says what differs: python -m tests.workbench.same_bytes FOLDER [ENVIRONMENT …].
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS")
# taken out of the environment of every run: what the place of the test sets must not hide a difference
CHOOSING = (
    "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "GLIBC_TUNABLES", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES",
    "NUMBA_CACHE_DIR", "OPENCV_CPU_DISABLE", *THREADS,
)  # fmt: skip
REFERENCE = "as it is"


def _without(*levels: str) -> str:
    """Those of numpy's dispatched features that this processor has: naming another is warned of."""
    return " ".join(f for f in np.show_config(mode="dicts")["SIMD Extensions"].get("found", ()) if f in levels)


def _threads(count: int) -> dict[str, str]:
    return dict.fromkeys(THREADS, str(count))


_AVX512 = ("X86_V4", "AVX512_ICL", "AVX512_SPR", "AVX512F", "AVX512CD", "AVX512_SKX", "AVX512_CLX", "AVX512_CNL")
_AVX2 = ("X86_V3", "AVX2", "FMA3")
_OLD = {  # all that is chosen at run time as on a processor without AVX2
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": _without(*_AVX512, *_AVX2),
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-AVX512VL,-AVX2_Usable,-FMA_Usable",
    "OPENCV_CPU_DISABLE": "AVX2,AVX512_SKX",
}
_GENERIC = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
ENVIRONMENTS = {
    REFERENCE: _threads(2),
    "one thread": _threads(1),
    "Haswell": {"OPENBLAS_CORETYPE": "Haswell"} | _threads(2),
    "SkylakeX": {"OPENBLAS_CORETYPE": "SkylakeX"} | _threads(2),
    "Sandybridge": {"OPENBLAS_CORETYPE": "Sandybridge"} | _threads(2),
    "numpy without AVX-512": {"NPY_DISABLE_CPU_FEATURES": _without(*_AVX512)} | _threads(2),
    "numpy without AVX2": {"NPY_DISABLE_CPU_FEATURES": _without(*_AVX512, *_AVX2)} | _threads(2),
    "glibc without FMA": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable"} | _threads(2),
    "OpenCV without AVX2": {"OPENCV_CPU_DISABLE": "AVX2,AVX512_SKX"} | _threads(2),
    "numba for any x86-64": _GENERIC | _threads(2),
    "old libraries": _OLD | _threads(1),
    "old": _OLD | _GENERIC | _threads(1),
}
PLAN = """
run = "calibrate"
repeats = 3
shard_trials = 3
keep_images = 0.2
[base.poses]
plans = 2
locations = 2
per_location = 4
verify = 2
[factors]
"jig.string_diameter_mm" = [0.2, 0.4]
clutter = [false, true]
"""
BOARD = """
kind = "checkerboard"
corners = [9, 6]
square_mm = 10.0
"""
SERIES = "import sys; from workbench.cli.main import run; sys.exit(max(run(line.split()) for line in sys.argv[1:]))"
WORKS = ("demo", "render", "sweep", "surfaces", "stripes", "board", "twin")


def digests(environment: str, folder: Path, cache: Path, *works: str) -> dict[str, str]:
    """Run the works into the folder and give the digest of every file there by its path.

    cache: a folder for what numba compiles for another processor; kept, the next run need not compile.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for work in works:
        commands = _commands(work, folder, ENVIRONMENTS[environment][THREADS[0]])
        processes = [commands] if work == "short" else [[command] for command in commands]
        for number, together in enumerate(processes):
            said = _output(environment, folder, cache, together)
            (folder / f"{work}_{number}.txt").write_text(said, encoding="utf-8")
    return {str(p.relative_to(folder)): _digest(p) for p in sorted(folder.rglob("*")) if p.is_file() and _counts(p)}


def differing(one: dict[str, str], other: dict[str, str]) -> list[str]:
    """The files that are not the same in both, or in one of them only."""
    return sorted(path for path in one.keys() | other.keys() if one.get(path) != other.get(path))


def _output(environment: str, folder: Path, cache: Path, commands: list[list[str]]) -> str:
    """What the commands print, one after the other in one process."""
    chosen = ENVIRONMENTS[environment]
    env = {k: v for k, v in os.environ.items() if k not in CHOOSING} | chosen
    env["PYOPENGL_PLATFORM"] = "none"  # the picture of the cell is the graphics driver's
    if "NUMBA_CPU_NAME" in chosen:
        env["NUMBA_CACHE_DIR"] = str(cache)
    program = ["-m", "workbench", *commands[0]] if len(commands) == 1 else ["-c", SERIES, *map(" ".join, commands)]
    done = subprocess.run([sys.executable, *program], cwd=folder, env=env, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):  # 1: an answer that its verdict does not trust
        raise RuntimeError(f"{environment}: {commands} ended with {done.returncode}:\n{done.stderr}")
    return done.stdout


def _commands(work: str, folder: Path, workers: str) -> list[list[str]]:
    if work == "demo":
        return [["demo", "--out", "demo"]]
    if work == "sweep":
        (folder / "plan.toml").write_text(PLAN, encoding="utf-8")
        return [["sweep", "plan.toml", "--out", "run", "--workers", workers]]
    init = ["init", "--robot", "abb_irb2400", "known"]
    if work == "render":
        render = ["render", "known/cell.toml", "--out", "cell", "--seed", "3", "--per-location", "3", "--full-truth"]
        return [init, render, ["calibrate", "cell", "--out", "solved", "--json"]]
    if work == "surfaces":
        init = ["init", "--target", "sphere", "--sensor", "lmi_gocator_2340", "ball"]
        render = ["render", "ball/cell.toml", "--out", "profiles", "--seed", "3", "--per-location", "4"]
        plan = ["plan", "ball/cell.toml", "--per-location", "3", "--json"]
        return [init, [*render, "--profiles", "gocator"], ["calibrate", "profiles", "--out", "found", "--json"], plan]
    if work == "stripes":
        init = ["init", "--target", "wedge", "wedge"]
        render = ["render", "wedge/cell.toml", "--out", "images", "--seed", "3", "--per-location", "3"]
        stripe = ["profile", "images/images", "--sensor", "images/sensor.toml", "--json"]
        return [init, render, stripe, ["calibrate", "images", "--out", "known", "--json"]]
    if work == "twin":  # of the images of "stripes"
        return [["twin", "images/images", "--sensor", "images/sensor.toml", "--out", "twin.toml", "--json"]]
    if work == "board":
        (folder / "board.toml").write_text(BOARD, encoding="utf-8")
        render = ["render", "--board", "board.toml", "--sensor", "nominal", "--views", "10", "--out", "board"]
        return [render, ["calibrate-sensor", "board", "--board", "board.toml", "--out", "sensor.toml", "--json"]]
    if work == "short":
        render = ["render", "known/cell.toml", "--out", "cell", "--seed", "3", "--per-location", "1"]
        return [init, render, ["extract", "cell", "--csv", "points.csv"]]
    raise ValueError(work)


def _counts(path: Path) -> bool:
    """Not what tells time or the environment itself."""
    return path.name not in ("timings.parquet", "environment.json", "run.lock")


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def main() -> None:
    """Run all works in the environments named, or in all, and print what differs from the reference."""
    out = Path(sys.argv[1]).resolve()
    reference = digests(REFERENCE, out / REFERENCE, out / "numba", *WORKS)
    for name in sys.argv[2:] or [n for n in ENVIRONMENTS if n != REFERENCE]:
        found = digests(name, out / name, out / "numba", *WORKS)
        sys.stdout.write(f"{name}: {differing(reference, found) or 'the same'}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
