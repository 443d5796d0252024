"""`calibrate --watch`: a dataset that grows row by row, its files half written now and then, and Ctrl-C."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib import CalibConfig
from calib.synthetic.cell import DESIGN
from tests.workbench.helpers import Cli
from tests.workbench.test_calibrate_profiles import write_ball
from workbench.cell import observe, solve
from workbench.files import read_cell
from workbench.plan import Round, rounds
from workbench.plan.watching import held_up

CONFIG = CalibConfig(model="full")
UNTIL_MM = 2.0  # σ of seven frames of one ball is larger, of nine smaller


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished dataset of a ball, by joints and robot."""
    folder = tmp_path_factory.mktemp("whole")
    write_ball(folder, "csv")
    return folder


def _begin(whole: Path, folder: Path) -> list[str]:
    """The dataset without frames; returns the lines of its frames.csv, those of one location alone."""
    for path in whole.glob("*.toml"):
        shutil.copy(path, folder)
    angles, lengths = (", ".join(f"{v:.6f}" for v in values) for values in (DESIGN.fixed_xyz_deg, DESIGN.t))
    with (folder / "cell.toml").open("a") as stream:
        stream.write(f"[scp_initial]\nrotation_deg = [{angles}]\ntranslation_mm = [{lengths}]\n")
    (folder / "profiles").mkdir()
    header, *rows = (whole / "frames.csv").read_text().splitlines(keepends=True)
    return [header, *(r for r in rows if ",A," in r)]


def _profile(row: str) -> str:
    return row.split(",")[1]


class OverError(Exception):
    """There is nothing more to be looked at."""


def _run(
    folder: Path, steps: list[Callable[[], None]], until: float | None, spare: int = 4
) -> tuple[list[Round], list[str]]:
    """All rounds while one step is done at each look, and what was said; spare looks follow the last step."""
    said: list[str] = []
    left = list(steps)
    idle = [spare]

    def sleep(_: float) -> None:
        if left:
            left.pop(0)()
        else:
            idle[0] -= 1
            if idle[0] < 0:
                raise OverError

    out: list[Round] = []
    with suppress(OverError):
        out.extend(rounds(folder, None, CONFIG, until, 0.0, said.append, sleep))
    return out, said


def test_a_growing_dataset_is_answered_until_sigma_is_reached(whole: Path, tmp_path: Path) -> None:
    lines = _begin(whole, tmp_path)
    table = tmp_path / "frames.csv"

    def copy(row: str) -> None:
        shutil.copy(whole / _profile(row), tmp_path / _profile(row))

    def write(count: int, cut: int = 0) -> Callable[[], None]:
        text = "".join(lines[: count + 1])

        def act() -> None:
            table.write_text(text[: len(text) - cut])

        return act

    def copy_last() -> None:
        for row in lines[8:10]:
            copy(row)

    def nothing() -> None:
        """Another look at the same files."""

    for row in lines[1:8]:
        copy(row)
    steps = [write(7, cut=9), nothing, nothing, write(7), nothing, nothing, write(9), nothing, nothing,
             copy_last, nothing, nothing]  # fmt: skip
    found, said = _run(tmp_path, steps, until=UNTIL_MM)
    assert any("last line of frames.csv to end" in s for s in said), said
    assert [len(r.cell.frames) for r in found] == [7, 9], said  # cut rows and rows without a profile are no frames
    assert [r.reached for r in found] == [False, True]
    first, last = (r.size_mm for r in found)
    assert first is not None
    assert last is not None
    cell = read_cell(tmp_path)
    same = solve(cell, observe(cell), CONFIG)
    assert same.T_hand_sensor is not None
    assert found[-1].result.T_hand_sensor is not None
    np.testing.assert_array_equal(found[-1].result.T_hand_sensor.matrix, same.T_hand_sensor.matrix)
    assert found[-1].next_pose is None
    ahead = found[0].next_pose
    assert ahead is not None, found[0].next_text
    assert ahead.size_mm < first
    assert ahead.frame.joints_rad is not None
    assert bool(cell.arm.within_limits(ahead.frame.joints_rad))
    assert last <= UNTIL_MM < first


def test_sigma_ends_a_watch_only_where_the_answer_is_sound_and_hangs_on_no_part(whole: Path) -> None:
    """A weak answer, one that nothing could be left out of, and one that a part moves by more than asked end none."""
    cell = read_cell(whole)
    found = solve(cell, observe(cell), CONFIG)
    assert found.left_out is not None
    parts = found.left_out.parts
    assert held_up(found, UNTIL_MM) == ""
    assert "weak" in held_up(replace(found, verdict=replace(found.verdict, code="weak")), UNTIL_MM)
    assert "too little" in held_up(replace(found, left_out=None), UNTIL_MM)
    assert "too little" in held_up(replace(found, left_out=replace(found.left_out, by="frame")), UNTIL_MM)
    far = replace(parts[1], shift=2.1 * UNTIL_MM * np.eye(6)[0])
    moved = replace(found.left_out, parts=(parts[0], far, *parts[2:]))
    assert f"hangs on location {far.name}" in held_up(replace(found, left_out=moved), UNTIL_MM)


def test_ctrl_c_ends_a_watch(cli: Cli, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _begin(whole, tmp_path)

    def interrupted(_: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("workbench.plan.watching.time.sleep", interrupted)
    outcome = cli("calibrate", tmp_path, "--watch")
    assert outcome.code == 130


def test_what_can_not_be_watched_is_said(cli: Cli, tmp_path: Path) -> None:
    assert cli("calibrate", tmp_path, "--until", 0.1).code == 2
    assert "cell.toml" in cli("calibrate", tmp_path, "--watch").err
