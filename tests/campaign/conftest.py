"""One small finished run that tests copy or read."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.campaign.plans import write_plan
from workbench.campaign import read_plan, run_campaign


@pytest.fixture(scope="session")
def small_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished run of one worker; its plan.toml lies beside it."""
    folder = tmp_path_factory.mktemp("campaign")
    run_campaign(read_plan(write_plan(folder / "plan.toml")), folder / "run", workers=1)
    return folder / "run"
