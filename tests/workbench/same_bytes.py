"""The same commands under other numeric environments, and which of their files differ; a script, too:

python tests/workbench/same_bytes.py FOLDER [ENVIRONMENT …] runs all commands under each and prints what differs.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

from numpy._core._multiarray_umath import __cpu_features__  # type: ignore[attr-defined]

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS")
AVX2 = ("X86_V3", "FMA3", "AVX2")
AVX512 = ("X86_V4", "AVX512F", "AVX512CD", "AVX512_SKX", "AVX512_CLX", "AVX512_CNL", "AVX512_ICL", "AVX512_SPR")
# set afresh in every run, so that none comes from the place where the test runs
OURS = (
    "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "GLIBC_TUNABLES", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES",
    "OPENCV_CPU_DISABLE", *THREADS,
)  # fmt: skip


def _dispatched(*features: str) -> str:
    """Those that this processor has and numpy was built to choose by: naming another is warned of."""
    from numpy._core._multiarray_umath import __cpu_dispatch__  # type: ignore[attr-defined]

    return " ".join(f for f in features if f in __cpu_dispatch__ and __cpu_features__.get(f))


def _threads(count: int) -> dict[str, str]:
    return dict.fromkeys(THREADS, str(count))


OLD = {  # a processor without AVX
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": _dispatched(*AVX512, *AVX2),
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
    "NUMBA_CPU_NAME": "generic",
    "OPENCV_CPU_DISABLE": "AVX2,AVX512_SKX",
} | _threads(1)
ENVIRONMENTS: dict[str, dict[str, str]] = {
    "native": _threads(2),
    "one_thread": _threads(1),
    "haswell": {"OPENBLAS_CORETYPE": "Haswell"} | _threads(2),
    "skylakex": {"OPENBLAS_CORETYPE": "SkylakeX"} | _threads(2),
    "sandybridge": {"OPENBLAS_CORETYPE": "Sandybridge"} | _threads(2),
    "no_avx512": {"NPY_DISABLE_CPU_FEATURES": _dispatched(*AVX512)} | _threads(2),
    "no_avx2": {"NPY_DISABLE_CPU_FEATURES": _dispatched(*AVX512, *AVX2)} | _threads(2),
    "glibc": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"} | _threads(2),
    "opencv": {"OPENCV_CPU_DISABLE": "AVX2,AVX512_SKX"} | _threads(2),
    "numba": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""} | _threads(2),
    "old": OLD | {"NUMBA_CPU_FEATURES": ""},
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
[base.calib]
model = "auto"
[factors]
"jig.string_diameter_mm" = [0.2, 0.4]
clutter = [false, true]
"""
LOCATIONS = """
[locations.A]
role = "calibrate"
T_base_jig = [[0, 0, 1, 1500], [0, -1, 0, 250], [1, 0, 0, 600], [0, 0, 0, 1]]
[locations.B]
role = "verify"
T_base_jig = [[0, 0, 1, 1500], [0, -1, 0, -250], [1, 0, 0, 700], [0, 0, 0, 1]]
"""


def run(name: str, folder: Path, cache: Path, *works: str) -> dict[str, str]:
    """Run the works under the environment and give the digest of every file by its path."""
    folder.mkdir(parents=True, exist_ok=True)
    chosen = ENVIRONMENTS[name]
    env = {k: v for k, v in os.environ.items() if k not in OURS} | chosen | {"PYOPENGL_PLATFORM": "none"}
    if "NUMBA_CPU_NAME" in chosen:  # compiled code is of one processor
        env["NUMBA_CACHE_DIR"] = str(cache)
    workers = chosen[THREADS[0]]
    for work in works:
        for number, command in enumerate(_commands(work, workers)):
            done = subprocess.run(
                [sys.executable, "-m", "workbench", *command], cwd=folder, env=env, capture_output=True, text=True
            )
            if done.returncode not in (0, 1):
                raise RuntimeError(f"{name}: {' '.join(command)}: {done.returncode}\n{done.stdout}\n{done.stderr}")
            (folder / f"{work}_{number}.txt").write_text(done.stdout, encoding="utf-8")
    return {str(p.relative_to(folder)): _digest(p) for p in sorted(folder.rglob("*")) if p.is_file() and _counts(p)}


def _commands(work: str, workers: str) -> list[list[str]]:
    if work == "demo":
        return [["demo", "--out", "demo", "--seed", "1"]]
    if work == "render":
        Path("cell.toml")
        return [
            ["init", "--sensor", "nominal", "--robot", "abb_irb2400", "known"],
            ["render", "known/cell.toml", "--out", "cell", "--seed", "3", "--per-location", "2", "--full-truth"],
            ["extract", "cell", "--out", "points.csv"],
        ]
    if work == "sweep":
        return [["sweep", "plan.toml", "--out", "run", "--workers", workers, "--json"]]
    raise ValueError(work)


def _counts(path: Path) -> bool:
    return path.name not in ("timings.parquet", "run.lock")


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def main() -> None:
    """Run every environment named, native first, and print what differs from it."""
    out = Path(sys.argv[1]).resolve()
    names = sys.argv[2:] or list(ENVIRONMENTS)
    reference = run("native", out / "native", out / "cache")
    for name in names:
        found = run(name, out / name, out / "cache")
        differing = [k for k in reference.keys() | found.keys() if reference.get(k) != found.get(k)]
        sys.stdout.write(f"{name}: {sorted(differing)}\n")


if __name__ == "__main__":
    main()
