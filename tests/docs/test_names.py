"""Names that the pages and docstrings give, of files, modules and functions, are there."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(p for p in (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")) if p.name != "CHANGELOG.md")
PACKAGES = ("assets", "calib", "extraction", "geometry", "jig_cad", "perceptron_emu", "workbench")
FOLDERS = (*PACKAGES, "benchmarks", "docs", "examples", "tests")
IN_TEXT = re.compile(rf"(?<![\w/.<-])(?:{'|'.join(FOLDERS)})/[\w/.-]*[\w/]")
DOTTED = re.compile(rf"`((?:{'|'.join(PACKAGES)})(?:\.\w+)+)")
SCRIPT = re.compile(r"`([\w/]+\.py)")
SETTINGS = {"calib.model"}  # of a campaign, not of a module


def ids(paths: list[Path]) -> list[str]:
    """Names of parametrised pages."""
    return [str(path.relative_to(ROOT)) for path in paths]


def exists(name: str) -> bool:
    """Whether a dotted name is a module, or an attribute of one."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            here = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            if not hasattr(here, part):
                return False
            here = getattr(here, part)
        return True
    return False


def files_named(text: str) -> Iterator[str]:
    """Paths of the repository that stand in a text."""
    for name in IN_TEXT.findall(text):
        yield name.rstrip(".")


@pytest.mark.parametrize("page", PAGES, ids=ids(PAGES))
def test_files_and_modules_of_pages(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    missing = [name for name in files_named(text) if not (ROOT / name).exists()]
    missing += [name for name in DOTTED.findall(text) if name not in SETTINGS and not exists(name)]
    known = [f"/{p.relative_to(ROOT).as_posix()}" for folder in FOLDERS for p in (ROOT / folder).rglob("*.py")]
    missing += [name for name in SCRIPT.findall(text) if not any(path.endswith(f"/{name}") for path in known)]
    assert not missing


@pytest.mark.parametrize("page", PAGES, ids=ids(PAGES))
def test_python_of_pages(page: Path) -> None:
    """Examples are Python, and what they import is there. Runs none of them."""
    for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and node.module:
                assert [a.name for a in node.names if not exists(f"{node.module}.{a.name}")] == [], block


def test_files_of_docstrings_and_comments() -> None:
    missing = []
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            names = [n for n in files_named(text) if n.endswith((".py", ".md"))]
            missing += [f"{path.relative_to(ROOT)}: {name}" for name in names if not (ROOT / name).exists()]
    assert not missing


def test_no_class_name_means_two_things() -> None:
    found: dict[str, list[str]] = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    found.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert not {name: paths for name, paths in found.items() if len(paths) > 1}
