"""Compiled kernels are kept, made anew when anything they are made of changes, and work where nothing can be kept.

Every run is a process of its own, as an edit between two runs is what must be noticed. Does not prove that compiling
anew gives other machine code only where it must.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.processes
ROOT = Path(__file__).resolve().parents[2]
PARTS = """
from typing import NamedTuple
from geometry.compiled import kernel

FACTOR = 2.0

class State(NamedTuple):
    first: float
    second: float

@kernel
def scaled(x):
    if x > 1e6:
        raise ValueError("too large", x)
    return 10.0 * x
"""
WHOLE = """
from geometry.compiled import kernel
from room.parts import FACTOR, State, scaled

@kernel
def answer(state: State) -> float:
    return FACTOR * below(state.first)

@kernel(fastmath=True)
def below(x):
    return scaled(x)
"""
ROOMS = """
import numpy as np
from geometry.compiled import kernel

@kernel
def rooms():
    return room_for(2) + room_for(3)

@kernel
def room_for(n):
    return np.ones(n).sum()
"""
PROGRAM = "from room.whole import State, answer; print(answer(State(1.0, 3.0)), *answer.stats.cache_hits.values())"


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A package of two modules, of which one calls the other's kernel."""
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "parts.py").write_text(PARTS)
    (folder / "whole.py").write_text(WHOLE)
    return folder


def run(room: Path, program: str = PROGRAM, **env: str) -> tuple[str, str]:
    """What a process that uses the package says on its two outputs."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    path = os.pathsep.join((str(room.parent), str(ROOT)))
    done = subprocess.run(
        (sys.executable, "-c", program),
        env=inherited | {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"} | env,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip(), done.stderr.strip()


def edit(file: Path, before: str, after: str) -> None:
    """Change a file, its date and size kept."""
    stat = file.stat()
    text = file.read_text()
    assert before in text
    assert len(before) == len(after)
    file.write_text(text.replace(before, after))
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def test_an_edit_in_another_file_is_noticed(room: Path) -> None:
    """Of a callee's callee, and of a constant; without one, nothing is compiled again."""
    assert run(room)[0] == "20.0"
    assert run(room)[0] == "20.0 1"
    edit(room / "parts.py", "10.0 * x", "30.0 * x")
    assert run(room)[0] == "60.0"
    edit(room / "parts.py", "FACTOR = 2.0", "FACTOR = 4.0")
    assert run(room)[0] == "120.0"
    assert run(room)[0] == "120.0 1"


def test_callees_are_compiled_within_their_callers_alone(room: Path) -> None:
    """Nothing of them is kept apart, and what they raise arrives, from code just compiled and from kept code."""
    program = (
        "from room.whole import State, answer\n"
        "try:\n    answer(State(1e9, 0.0))\n"
        "except ValueError as error:\n    print(*error.args, *answer.stats.cache_hits.values())"
    )
    assert run(room, program)[0] == "too large 1000000000.0"
    assert [file.name.split("-")[0] for file in room.rglob("*.nbi")] == ["whole.answer"]
    assert run(room, program)[0] == "too large 1000000000.0 1"


def test_a_callee_is_compiled_once_for_all_written_numbers(room: Path) -> None:
    """A compilation for each of them would be numba's way."""
    (room / "parts.py").write_text(ROOMS)
    said, _ = run(room, "from room.parts import rooms, room_for; print(rooms(), len(room_for._inside.overloads))")
    assert said == "5.0 1"


def test_kept_code_loads_without_what_it_was_compiled_from(room: Path) -> None:
    """Arrays are made by kernels of numba's own, which it would import again."""
    (room / "parts.py").write_text(ROOMS)
    program = "import sys; from room.parts import rooms; print(rooms(), 'numba.np.arrayobj' in sys.modules)"
    assert run(room, program)[0] == "5.0 True"
    assert run(room, program)[0] == "5.0 False"


def test_a_newer_numba_compiles_them_its_own_way(room: Path) -> None:
    """What numba does not promise to keep is used with releases that it was tried with only."""
    program = f"from geometry import compiler; compiler._NEWEST_TRIED = (0, 0); {PROGRAM}"
    assert run(room, program)[0] == "20.0"
    assert {file.name.split("-")[0] for file in room.rglob("*.nbi")} == {"whole.answer", "whole.below", "parts.scaled"}
    assert run(room, program)[0] == "20.0 1"


def test_changed_named_tuples_are_noticed_and_nothing_stale_stays(room: Path) -> None:
    """Fields of another order, and a class of another name: what was compiled speaks of one that is no more."""
    assert run(room)[0] == "20.0"
    kept = len(list(room.rglob("*.nb?")))
    text = (room / "parts.py").read_text()
    swapped = text.replace("first", "x").replace("second", "first").replace("x:", "second:")
    (room / "parts.py").write_text(swapped)
    assert run(room)[0] == "60.0"
    for file in (room / "parts.py", room / "whole.py"):
        file.write_text(file.read_text().replace("State", "Condition"))
    assert run(room, PROGRAM.replace("State", "Condition"))[0] == "60.0"
    assert len(list(room.rglob("*.nb?"))) == kept


def test_nothing_can_be_written(room: Path) -> None:
    """A file where each folder would be: refused to the superuser too, who may write into read-only ones."""
    (room / "__pycache__").touch()
    nowhere = str(room / "__init__.py")
    answer, said = run(room, HOME=nowhere, XDG_CACHE_HOME=nowhere)
    assert answer == "20.0"
    assert said.count("NUMBA_CACHE_DIR") == 1
    assert len(said.splitlines()) == 1


def test_cache_folder_of_the_users_choice(room: Path, tmp_path: Path) -> None:
    run(room, NUMBA_CACHE_DIR=str(tmp_path / "kept"))
    assert list((tmp_path / "kept").rglob("*.nbi"))
    assert not list(room.rglob("*.nbi"))


def test_functions_of_others_are_left_alone(room: Path) -> None:
    program = (
        "import numba, room.whole as whole\n"
        "assert not numba.config.CACHE_LOCATOR_CLASSES\n"
        "print(whole.below(1.0))"  # a kernel that others call can be called by itself
    )
    assert run(room, program)[0] == "10.0"
