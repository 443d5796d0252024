"""The distribution stands alone: built, installed in an empty environment, and run outside the checkout.

The wheel is made of the sdist, so that both are whole. By default it is tried on the Python that runs the tests; with
PACKAGING_MATRIX set (`make test-packaging MATRIX=1`) on every Python that is supported, and with the oldest numpy that
is allowed. Does not prove that it installs on other systems.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
MATRIX = "PACKAGING_MATRIX"
PYTHONS = ("3.11", "3.12", "3.13")
HERE = f"{sys.version_info.major}.{sys.version_info.minor}"


def run(*command: str | Path, cwd: Path) -> str:
    mine = ("PYTHONPATH", "VIRTUAL_ENV", "NUMBA_CACHE_DIR")
    env = {k: v for k, v in os.environ.items() if k not in mine}
    done = subprocess.run([str(c) for c in command], cwd=cwd, capture_output=True, text=True, env=env, check=False)
    assert done.returncode == 0, f"{command} ended with {done.returncode}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    source = tmp_path_factory.mktemp("source") / "checkout"
    listed = run("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", cwd=ROOT).split("\0")
    for name in filter(None, listed):
        if (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, source / name)
    run(sys.executable, "-m", "build", "--outdir", source / "dist", source, cwd=source)
    (built,) = (source / "dist").glob("*.whl")
    return built


def interpreter(version: str) -> str:
    """An interpreter of that version: this one, one on the path, or one of pyenv's; else the test is skipped."""
    if version == HERE:
        return sys.executable
    found = shutil.which(f"python{version}")
    if found and subprocess.run([found, "--version"], capture_output=True, check=False).returncode == 0:
        return found
    kept = sorted(Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")).glob(f"versions/{version}.*/bin/python"))
    if not kept:
        pytest.skip(f"no Python {version} on this machine: neither python{version} on the path nor one of pyenv's")
    return str(kept[-1])


def oldest_numpy() -> str:
    """The requirement of the oldest numpy that pyproject.toml allows."""
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    (lowest,) = (m[1] for m in (re.fullmatch(r"numpy>=([\d.]+).*", line) for line in needed) if m)
    return f"numpy=={lowest}.*"


def environment(folder: Path, version: str, *packages: str | Path) -> Path:
    """Make an empty environment with the packages; where its programs are."""
    run(interpreter(version), "-m", "venv", folder, cwd=folder.parent)
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    run(programs / "python", "-m", "pip", "install", "-q", "--disable-pip-version-check", *packages, cwd=folder.parent)
    return programs


@pytest.mark.packaging
def test_wheel_installs_in_an_empty_environment_and_runs_the_demo(wheel: Path, tmp_path: Path) -> None:
    programs = environment(tmp_path / "env", HERE, wheel)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    run(programs / "perceptron-emu", "demo", "--out", elsewhere / "demo", cwd=elsewhere)
    result = json.loads((elsewhere / "demo" / "result.json").read_text())
    assert result["verdict"]["code"] in ("ok", "model_misfit")
    assert len(list((elsewhere / "demo").rglob("images/*.png"))) == 28
    answer = json.loads(run(programs / "perceptron-emu", "calibrate", elsewhere / "demo", "--json", cwd=elsewhere))
    np.testing.assert_allclose(answer["T_hand_sensor"], result["T_hand_sensor"], rtol=0, atol=1e-9)


@pytest.mark.packaging
@pytest.mark.skipif(MATRIX not in os.environ, reason="other Pythons and numpys: make test-packaging MATRIX=1")
@pytest.mark.parametrize(("version", "numpy"), [(PYTHONS[0], oldest_numpy()), *((v, "numpy") for v in PYTHONS[1:])])
def test_wheel_answers_on_every_python_and_with_the_oldest_numpy(
    wheel: Path, tmp_path: Path, version: str, numpy: str
) -> None:
    """Help, the recording that ships, and one profile: the same answer as here, to what another numpy may change."""
    programs = environment(tmp_path / "env", version, wheel, numpy)
    command = programs / "perceptron-emu"
    assert "calibrate" in run(command, "--help", cwd=tmp_path)
    where = "import assets; print(assets.path('samples', 'cell_a'))"
    sample = Path(run(programs / "python", "-c", where, cwd=tmp_path).strip())
    assert programs.parent in sample.parents
    there = json.loads(run(command, "calibrate", sample, "--json", cwd=tmp_path))
    here = json.loads(run(sys.executable, "-m", "workbench", "calibrate", sample, "--json", cwd=ROOT))
    assert there["verdict"] == here["verdict"]
    np.testing.assert_allclose(there["T_hand_sensor"], here["T_hand_sensor"], rtol=0, atol=1e-6)
    stripe = 180 * np.exp(-0.5 * ((np.arange(200)[:, None] - 80.3) / 2.5) ** 2) * np.ones((1, 300))
    assert cv2.imwrite(str(tmp_path / "stripe.png"), np.rint(stripe).astype(np.uint8))
    (seen,) = json.loads(run(command, "profile", tmp_path / "stripe.png", "--json", cwd=tmp_path))["images"]
    np.testing.assert_allclose([p["v_px"] for p in seen["points"]], 80.3, rtol=0, atol=0.02)
