"""Every tutorial followed as it is written: its commands and its Python, one after another, in an empty folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
BLOCK = re.compile(r"^```(console|python)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def steps(page: Path) -> list[list[str]]:
    """The command lines of a page; Python as a script."""
    found: list[list[str]] = []
    for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "python":
            found.append([sys.executable, "-c", text])
            continue
        lines = [line[2:] for line in text.splitlines() if line.startswith("$ ")]
        found += [["bash", "-c", line.replace("EXAMPLES", str(ROOT / "examples"))] for line in lines]
    return found


@pytest.mark.tutorials
@pytest.mark.parametrize("page", TUTORIALS, ids=[p.stem for p in TUTORIALS])
def test_a_tutorial_runs_as_it_is_written(page: Path, tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    todo = steps(page)
    assert todo
    for step in todo:
        run = subprocess.run(
            step, cwd=tmp_path, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, f"{step[-1]}\n{run.stdout[-2000:]}\n{run.stderr[-2000:]}"
