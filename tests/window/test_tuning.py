"""The search: its space, what it minimises, that it resumes, comes back from wrong settings and keeps good defaults."""

from __future__ import annotations

import errno
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from extraction import ExtractionConfig
from geometry import InputError
from workbench.cli.main import run
from workbench.files import read_settings
from workbench.opened import ImageRequest, open_images
from workbench.tune import Task, judge, make_task, search
from workbench.tune.cost import MISS_MM, FrameCost, total
from workbench.tune.space import space, values_of, with_values
from workbench.tune.task import split

pytest.importorskip("optuna", reason="optuna is not installed")

BLIND = ExtractionConfig.model_validate({"detect": {"min_height_dn": 60.0, "blur_sigma_px": 3.9, "threshold": 39.0}})


@pytest.fixture(scope="module")
def task(cell_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Task:
    """Twelve of the images, so that a trial takes a fraction of a second."""
    folder = tmp_path_factory.mktemp("small") / "cell"
    shutil.copytree(cell_folder, folder)
    lines = (folder / "frames.csv").read_text().splitlines()
    (folder / "frames.csv").write_text("\n".join([lines[0], *lines[1::2]][:13]) + "\n")
    return make_task(open_images(ImageRequest((folder,))), seed=1)


def told(*_: object) -> None:
    """Nobody looks."""


def test_the_space_holds_the_defaults() -> None:
    dimensions = space(ExtractionConfig)
    assert len(dimensions) >= 6
    start = ExtractionConfig()
    assert with_values(start, values_of(start, dimensions)) == start
    assert not {"detect.max_candidates", "localise.max_iterations"} & {d.key for d in dimensions}


def test_the_split_is_even_at_every_location() -> None:
    locations = ["A"] * 7 + ["B"] * 8
    train, held_out = split(locations, range(15), seed=3)
    assert sorted(train + held_out) == list(range(15))
    for name in "AB":
        counts = [sum(locations[i] == name for i in part) for part in (train, held_out)]
        assert abs(counts[0] - counts[1]) <= 1
    assert split(locations, range(15), 3) == (train, held_out)
    assert split(locations, range(15), 4) != (train, held_out)


def test_loss_is_the_rms_and_a_miss_costs_its_price() -> None:
    good = FrameCost(cost_mm2=5 * 0.02**2, wanted=5, square_mm2=5 * 0.02**2, measured=5, missed=0, false=0)
    np.testing.assert_allclose([total([good]).loss_mm, total([good]).rms_mm], 0.02, rtol=1e-12)
    lost = FrameCost(cost_mm2=5 * MISS_MM**2, wanted=5, square_mm2=0, measured=0, missed=5, false=0)
    both = total([good, lost])
    assert both.missed == 5
    np.testing.assert_allclose(both.loss_mm, np.sqrt((0.02**2 + MISS_MM**2) / 2), rtol=1e-12)


def test_blind_settings_cost_every_point(task: Task) -> None:
    score = total(task.scores(task.train, BLIND))
    assert score.missed == score.wanted > 0
    np.testing.assert_allclose(score.loss_mm, MISS_MM, rtol=1e-12)


def test_consistency_needs_no_truth(task: Task) -> None:
    """The jig's own geometry ranks good settings before blind ones, and its figure is of the size of the noise."""
    blind_task = replace(task, source=replace(task.source, truth={}))
    good, bad = (total(blind_task.scores(task.train, c)) for c in (ExtractionConfig(), BLIND))
    assert 0.0 < good.rms_mm < 0.2
    assert good.loss_mm < bad.loss_mm


def test_the_search_comes_back_from_blind_settings_and_resumes(task: Task, tmp_path: Path) -> None:
    journal = tmp_path / "tune.journal"
    first = search(task, BLIND, 6, 2, journal, told)
    assert (first.trials, first.resumed) == (6, 0)
    again = search(task, BLIND, 6, 2, journal, told)  # nothing left to do
    assert (again.trials, again.resumed) == (6, 6)
    assert again.config == first.config
    more = search(task, BLIND, 14, 2, journal, told)
    assert (more.trials, more.resumed) == (14, 6)
    assert more.train_loss_mm <= first.train_loss_mm
    assert more.train_loss_mm < 0.6 * MISS_MM


def test_the_judge_keeps_defaults_that_are_as_good(task: Task) -> None:
    defaults = ExtractionConfig()
    same = judge(task, defaults, defaults, seed=0)
    assert (same.gain, same.better) == (0.0, False)
    worse = judge(task, defaults, BLIND, seed=0)
    assert worse.gain < 0
    assert not worse.better
    assert worse.gain_90[0] <= worse.gain <= worse.gain_90[1]


def test_a_damaged_journal_is_said(task: Task, tmp_path: Path) -> None:
    journal = tmp_path / "tune.journal"
    journal.write_text("this is no journal\n" * 3)
    with pytest.raises(InputError, match="damaged"):
        search(task, ExtractionConfig(), 1, 0, journal, told)


def test_a_journal_s_unfinished_line_is_dropped(task: Task, tmp_path: Path) -> None:
    """A killed search leaves such a line; one trial stands before it, and the search goes on from there."""
    journal = tmp_path / "tune.journal"
    search(task, ExtractionConfig(), 1, 0, journal, told)
    whole = journal.read_bytes()
    journal.write_bytes(whole + whole[: whole.find(b"\n") // 2])
    assert search(task, ExtractionConfig(), 2, 0, journal, told).resumed == 1


@pytest.mark.parametrize("room", [0, 1, 6])
def test_a_full_disk_is_said(task: Task, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, room: int) -> None:
    """At the study, at its first trial and amid a trial; what stood in the journal before serves the next search."""
    written, real = [], os.fsync

    def full(number: int) -> None:
        written.append(number)
        if len(written) > room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(number)

    journal = tmp_path / "tune.journal"
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match=r"tune\.journal: the search can not be kept there \(No space left"):
        search(task, ExtractionConfig(), 2, 0, journal, told)
    monkeypatch.undo()
    assert search(task, ExtractionConfig(), 1, 0, journal, told).trials == 1


def test_too_few_images(cell_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "three"
    folder.mkdir()
    for i in range(3):
        shutil.copy(cell_folder / "images" / f"00{i}.png", folder)
    request = ImageRequest((folder,), sensor=cell_folder / "sensor.toml", jig=cell_folder / "jig.toml")
    with pytest.raises(InputError, match="at least 4"):
        make_task(open_images(request), 0)


def test_bare_images_need_a_jig_to_search(cell_folder: Path) -> None:
    with pytest.raises(InputError, match="--jig"):
        make_task(open_images(ImageRequest((cell_folder / "images",), sensor=cell_folder / "sensor.toml")), 0)


def test_the_command_prints_its_judgement_and_saves(
    task: Task, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = task.source.pictures.root
    assert run(["tune", str(folder), "--auto", "2", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "2 trials" in printed
    assert "held out" in printed
    assert "defaults" in printed
    assert ("already as good" in printed) != ("beat the defaults" in printed)
    assert run(["tune", str(folder), "--auto", "2", "--out", str(tmp_path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["trials"], told["better"]) == (2, "beat the defaults" in printed)
    assert f"{told['scores']['found']['loss_mm']:.4f}" in printed
    assert run(["tune", str(folder), "--json"]) == 2
    saved = read_settings([tmp_path / "tuned.toml"]).extraction
    if "already as good" in printed:
        assert saved == ExtractionConfig()
