"""A dataset calibrated in one call gives what the command gives."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import workbench
from geometry import InputError
from workbench import calibrate_cell

SAMPLE = Path(__file__).parents[2] / "assets" / "samples" / "cell_a"


def test_what_the_command_writes_in_one_call(tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    answer = calibrate_cell(str(SAMPLE), progress=lambda done, all_: steps.append((done, all_)))
    assert steps
    assert steps[-1][0] == steps[-1][1] == len(answer.cell.frames)
    assert str(answer) == str(answer.result)
    answer.save(tmp_path / "out")
    written = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert json.loads(answer.to_json()) == written
    assert written["inputs"]
    answer.report(tmp_path / "page.html")
    assert answer.result.verdict.text in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert len(answer.plot().axes) == len(answer.result.locations)


def test_a_folder_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing"):
        calibrate_cell(tmp_path / "nothing")


def test_what_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="calibrate_house"):
        workbench.calibrate_house  # noqa: B018 # asked for, not used
