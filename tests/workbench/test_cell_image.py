"""The picture of the cell in report and demo, with OpenGL and without."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from geometry import MissingDependencyError
from perceptron_emu.gl import gl_problem
from tests.workbench.helpers import Cli
from workbench.cell import observe, solve
from workbench.cli import diagnosis
from workbench.files import Settings
from workbench.report import cell_image
from workbench.report.cell_picture import cell_view

needs_gl = pytest.mark.skipif((PROBLEM := gl_problem()) is not None, reason=str(PROBLEM))
FIGURE = 'alt="Arm, sensor'


def test_the_view_is_the_solved_cell(recording: Path) -> None:
    """The chain ends at the hand, the sensor sits on it by the solved SCP, every place has its jig."""
    from workbench.files import read_cell

    cell = read_cell(recording)
    result = solve(cell, observe(cell), Settings().calib)
    view = cell_view(cell, result)
    assert view is not None
    assert view.links is not None
    assert result.T_hand_sensor is not None
    assert len(view.jigs) == 4
    assert view.links.t.shape == (cell.robot.n_joints + 2, 3)
    offset = view.links.R[-1].T @ (view.T_base_sensor.t - view.links.t[-1])
    np.testing.assert_allclose(offset, result.T_hand_sensor.t, rtol=0, atol=1e-9)


@needs_gl
def test_the_report_shows_the_cell(cli: Cli, recording: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    result = cli("calibrate", recording, "--report", page)
    assert result.code == 0
    assert "no picture" not in result.err
    html = page.read_text(encoding="utf-8")
    assert FIGURE in html
    assert not re.findall(r"""(?:src|href)=["'](?!data:)""", html)


def test_without_opengl_one_line_says_so(
    cli: Cli, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def absent(*_: object) -> None:
        raise MissingDependencyError("neither EGL nor OSMesa is installed")

    monkeypatch.setattr("workbench.report.cell_picture.cell_picture", absent)
    page = tmp_path / "report.html"
    result = cli("calibrate", recording, "--report", page)
    assert result.code == 0
    assert result.err.count("no picture of the cell: neither EGL nor OSMesa is installed") == 1
    assert len(result.err.strip().splitlines()) == 1
    assert FIGURE not in page.read_text(encoding="utf-8")


def test_without_a_used_frame_there_is_no_picture(dataset: Path) -> None:
    from workbench.files import read_cell

    for image in (dataset / "images").iterdir():
        image.write_bytes(b"")
    cell = read_cell(dataset)
    picture, remark = cell_image(cell, solve(cell, observe(cell), Settings().calib))
    assert picture is None
    assert "no frame of it was used" in remark


def test_doctor_says_how_to_get_opengl(monkeypatch: pytest.MonkeyPatch) -> None:
    import perceptron_emu.gl.context as gl

    monkeypatch.setattr(gl, "_renderer", gl.load_pyrender)  # the one renderer of this process stays as it is
    monkeypatch.setattr(gl, "LIBRARIES", {"egl": "libNone.so", "osmesa": "libNone.so"})
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    finding = diagnosis._gl()
    assert finding.state == "absent"
    for word in ("neither EGL nor OSMesa", "libegl1", "libosmesa6", "--renderer pyrender"):
        assert word in finding.detail
