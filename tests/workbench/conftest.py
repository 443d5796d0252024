"""A small recorded cell, made once, and a copy of it for each test that breaks something."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.workbench.helpers import Cli, Outcome
from workbench.cli.main import run


@pytest.fixture
def cli(capfd: pytest.CaptureFixture[str]) -> Cli:
    """Run the command line in this process; no error may pass as a traceback."""

    def call(*arguments: object) -> Outcome:
        capfd.readouterr()
        code = run([str(a) for a in arguments])
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        return Outcome(code, out, err)

    return call


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An emulated recording with truth: four places, three views each."""
    folder = tmp_path_factory.mktemp("cell")
    assert run(["init", str(folder / "plan")]) == 0
    out = folder / "recording"
    assert run(["render", str(folder / "plan"), "--out", str(out), "--per-location", "3", "--seed", "3"]) == 0
    return out


@pytest.fixture(scope="session")
def answer(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What `calibrate --json` says of the recording."""
    out = tmp_path_factory.mktemp("answer")
    assert run(["calibrate", str(recording), "--out", str(out)]) == 0
    return json.loads((out / "result.json").read_text())


@pytest.fixture
def dataset(recording: Path, tmp_path: Path) -> Path:
    """A copy of the recording that a test may break."""
    return Path(shutil.copytree(recording, tmp_path / "dataset"))
