"""The command line itself: help without heavy imports, wrong arguments, pipes, what goes to which stream."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.text import Text

import workbench.files
from tests.workbench.helpers import Cli
from workbench.cli.lazy import COMMANDS, load

HEAVY = ("numpy", "scipy", "cv2", "numba", "matplotlib", "pydantic", "trimesh", "skimage")


def test_help_imports_nothing_heavy() -> None:
    """What makes help slow is importing; the time itself is the machine's."""
    code = (
        "import sys\nfrom workbench.cli.main import run\ncode = run(['--help'])\n"
        f"print([m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr)\nsys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert done.stderr.strip() == "[]"
    for name in COMMANDS:
        assert name in done.stdout


@pytest.mark.parametrize(("typed", "offered"), [("calibrate-", ["calibrate-sensor"]), ("compare --m", ["--max-mm"])])
def test_a_shell_completes_commands_and_options(typed: str, offered: list[str]) -> None:
    words = f"perceptron-emu {typed}"
    asked = {"_PERCEPTRON_EMU_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    done = subprocess.run(
        [sys.executable, "-m", "workbench"], env=os.environ | asked, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == offered


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(cli: Cli, name: str) -> None:
    result = cli(name, "--help")
    assert result.code == 0
    assert "--help" in result.out
    assert load(name).help


@pytest.mark.parametrize("name", COMMANDS)
def test_help_keeps_square_brackets(name: str) -> None:
    """Square brackets are markup to the help's printer: unescaped, `[uncertainty]` vanishes from the sentence."""
    command = load(name)
    for one in (command, *getattr(command, "commands", {}).values()):
        for text in (one.help, *(getattr(p, "help", None) for p in one.params)):
            written = (text or "").replace("\\[", "[")
            assert Text.from_markup(text or "").plain == written


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("callibrate", "x"), ("calibrate",)),
        (("calibrate",), ("DATASET",)),
        (("calibrate", "x", "--modle", "scp"), ("--model",)),
        (("calibrate", "x", "--model", "huge"), ("huge", "scp")),
        (("calibrate", "nowhere"), ("nowhere",)),
        (("extract", "nowhere.png"), ("--sensor",)),
        (("render", "nowhere", "--out", "x"), ("nowhere",)),
        (("pose", "nowhere.csv"), ("nowhere.csv",)),
        (("jig", "nowhere.toml"), ("nowhere.toml",)),
        (("jig", "papper"), ("paper",)),
        (("demo", "--seed", "-1"), ("seed",)),
    ],
)
def test_wrong_arguments(cli: Cli, arguments: tuple[str, ...], words: tuple[str, ...]) -> None:
    result = cli(*arguments)
    assert result.code == 2
    assert result.out == ""
    assert len(result.err.splitlines()) == 1
    for word in words:
        assert word in result.err


def test_version(cli: Cli) -> None:
    result = cli("--version")
    assert result.code == 0
    assert result.out.startswith("perceptron-emu ")


def test_a_closed_pipe_is_no_error() -> None:
    """`perceptron-emu jig --toml | head -0`: the reader is gone before anything is written."""
    command = f"{sys.executable} -m workbench jig --toml | head -c 0"
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr


def test_a_fault_of_the_program_is_one_line(cli: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def fails(_: Path) -> None:
        raise ZeroDivisionError("boom")

    monkeypatch.setattr(workbench.files, "read_cell", fails)
    result = cli("calibrate", tmp_path)
    assert result.code == 70
    assert "ZeroDivisionError" in result.err
    assert "--debug" in result.err


def test_interruption_is_130(cli: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def stops(_: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(workbench.files, "read_cell", stops)
    assert cli("calibrate", tmp_path).code == 130


def test_output_that_can_not_be_written(cli: Cli, recording: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    result = cli("extract", recording, "--csv", tmp_path / "file" / "points.csv")
    assert result.code == 2
    assert "can not be written" in result.err


@pytest.mark.parametrize(("module", "extra"), [("pyarrow", "campaign"), ("starlette", "window")])
def test_a_missing_extra_is_said(cli: Cli, monkeypatch: pytest.MonkeyPatch, module: str, extra: str) -> None:
    def fails(*_: object, **__: object) -> None:
        raise ModuleNotFoundError(f"No module named '{module}'", name=module)

    monkeypatch.setattr(workbench.files, "read_cell", fails)
    result = cli("calibrate", "anywhere")
    assert result.code == 2
    assert f"perceptron-emu[{extra}]" in result.err


NARROW = """
import io, sys
from workbench.cli.main import run
sys.stdout = io.TextIOWrapper(open(1, "wb", closefd=False), encoding="cp1252")
sys.stderr = io.TextIOWrapper(open(2, "wb", closefd=False), encoding="ascii")
code = run(sys.argv[1:])
sys.stdout.flush(); sys.stderr.flush()
sys.exit(code)
"""


@pytest.mark.parametrize(
    "arguments", [["--help"], ["plan", "--help"], ["calibrate", "missing → σ"], ["init", "--list"]]
)
def test_a_console_of_few_characters(arguments: list[str]) -> None:
    """Windows' code page for what is redirected, ASCII for errors: characters are spelled out, nothing fails."""
    done = subprocess.run([sys.executable, "-c", NARROW, *arguments], capture_output=True, check=False)
    assert done.returncode == (2 if "missing" in arguments[1 % len(arguments)] else 0), done.stderr
    done.stdout.decode("cp1252")
    text = done.stderr.decode("ascii")
    assert "sigma" in text or "missing" not in "".join(arguments)


INTERRUPTED = """
import os, signal, sys, types
from workbench.cli import main
class Swallows:
    def find_spec(self, name, path=None, target=None):
        if name == "typer":
            sys.meta_path.remove(self)
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except BaseException:
                pass
        return None
sys.meta_path.insert(0, Swallows())
sys.argv = ["perceptron-emu", "--help"]
main.main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent in another way there")
def test_interrupts_are_not_lost_in_imports() -> None:
    """A third party's import that swallows whatever is raised in it would go on as if nothing had been."""
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert done.stderr.strip() == "interrupted"
    assert not done.stdout


SWALLOWED_BY_LLVM = """
import os, signal, sys
from workbench.cli import main
called_back = compile("os.kill(os.getpid(), signal.SIGINT)", os.path.join("a", "llvmlite", "b.py"), "exec")
def run(arguments):
    try:
        exec(called_back)
    except BaseException:
        pass
    return 0
main.run = run
main.main()
"""
SWALLOWED_BY_PYDANTIC = """
import os, signal
import pydantic
from workbench.cli import main
class Own:
    @classmethod
    def __get_pydantic_core_schema__(cls, source, handler):
        os.kill(os.getpid(), signal.SIGINT)
        return handler.generate_schema(str)
def run(arguments):
    try:
        pydantic.create_model("Model", own=(Own, ...))
    except BaseException:
        pass
    return 0
main.run = run
main.main()
"""
IN_A_DESTRUCTOR = """
import os, signal
from workbench.cli import main
class Gone:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
def run(arguments):
    Gone()
    print("went on")
    return 0
main.run = run
main.main()
"""
TAKEN_DOWN = """
import os, signal, sys
from workbench.cli import main
class Last:
    def __del__(self, kill=os.kill, pid=os.getpid(), number=signal.SIGINT):
        kill(pid, number)
sys.modules["last"] = Last()
main.run = lambda arguments: 0
main.main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent in another way there")
@pytest.mark.parametrize(
    ("script", "code"),
    [(SWALLOWED_BY_LLVM, 130), (SWALLOWED_BY_PYDANTIC, 130), (IN_A_DESTRUCTOR, 130), (TAKEN_DOWN, 0)],
)
def test_interrupts_are_neither_lost_nor_too_late(script: str, code: int) -> None:
    """In what LLVM or pydantic calls back, or in a destructor, nothing can be raised; when all is written it changes
    nothing.
    """
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert not done.stdout
