"""What a command does not use it does not import: half of a short command's time was imports.

Does not prove that it is quick: the time itself is the machine's.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import assets
from tests.workbench.test_calibrate_profiles import write_ball

FACES = (
    "calib.synthetic", "extraction", "extraction.stripe", "jig_cad", "perceptron_emu", "workbench.cell",
    "workbench.profiles", "workbench.report", "workbench.window",
)  # fmt: skip
NEVER = (
    "scipy.stats", "scipy.optimize", "scipy.linalg", "scipy.spatial", "scipy.ndimage", "skimage", "trimesh", "networkx",
    "scipy.special", "matplotlib", "numpy.f2py", "numpy.testing", "pyrender", "jinja2", "perceptron_emu.scene",
    "extraction.gapflush", "extraction.board", "extraction.stripe.pipeline", "workbench.plan", "workbench.report.page",
)  # fmt: skip
OF_PROFILES = (*NEVER, "numpy.polynomial", "numba", "cv2", "extraction.spots")
OF_IMAGES = (*NEVER, "workbench.profiles.files")


def imported(arguments: list[str], modules: tuple[str, ...]) -> tuple[int, list[str]]:
    """A command's exit code and which of some modules it has imported."""
    code = (
        "import sys\nfrom workbench.cli.main import run\ncode = run(sys.argv[1:])\n"
        f"print(*[m for m in {modules!r} if m in sys.modules], file=sys.stderr)\nsys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
    return done.returncode, done.stderr.splitlines()[-1].split()


def test_calibrating_by_profiles_imports_nothing_of_images(tmp_path: Path) -> None:
    write_ball(tmp_path, "csv", fanuc=True)  # a format that states no field of view, which a kernel would compare with
    assert imported(["calibrate", str(tmp_path)], OF_PROFILES) == (0, [])


def test_calibrating_by_images_imports_nothing_of_stripes_or_of_the_emulator() -> None:
    assert imported(["calibrate", str(assets.path("samples", "cell_a"))], OF_IMAGES) == (0, [])


@pytest.mark.parametrize("face", FACES)
def test_every_name_of_a_lazy_face_is_there(face: str) -> None:
    module = import_module(face)
    for name in module.__all__:
        assert getattr(module, name) is not None
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = module.no_such_name


def test_special_functions_come_from_one_place() -> None:
    """That which spares what scipy would load beside them; its tools are there for who asks."""
    root = Path(__file__).resolve().parents[2]
    packages = ("geometry", "jig_cad", "extraction", "calib", "perceptron_emu", "workbench")
    files = [file for package in packages for file in (root / package).rglob("*.py")]
    assert [f.name for f in files if "scipy.special" in f.read_text().replace("`", "")] == ["special.py"]
    code = (
        "import geometry.special as ours, numpy, scipy.special\nassert scipy.special.erf is ours.erf and numpy.testing"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("said", "blas"), [({}, "1"), ({"OMP_NUM_THREADS": "2"}, "None"), ({"OPENBLAS_NUM_THREADS": "2"}, "2")]
)
def test_a_command_has_one_thread_of_linear_algebra(said: dict[str, str], blas: str) -> None:
    """Unless the user says otherwise; told before numpy is imported, which looks but once."""
    code = (
        "import os, sys\nfrom workbench.cli import main\nassert 'numpy' not in sys.modules\n"
        "main.run = lambda _: print(os.environ.get('OPENBLAS_NUM_THREADS')) or 0\nmain.main()"
    )
    clean = {k: v for k, v in os.environ.items() if k not in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=clean | said)
    assert done.stdout.split() == [blas]
