"""Pages that can be followed: links resolve, every page is reachable, commands and dependencies are as told.

Whether the words are true is not tested here; tests/docs/test_formats.py holds the keys of files against their readers.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from typer.core import TyperGroup

ROOT = Path(__file__).parents[2]
PAGES = sorted(ROOT.glob("*.md")) + sorted((ROOT / "docs").glob("*.md"))
IDS = [str(page.relative_to(ROOT)) for page in PAGES]
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
INLINE = re.compile(r"`(perceptron-emu [a-z][^`]*)`")


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_relative_links_resolve(page: Path) -> None:
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        assert target.exists(), f"{page.name}: {link}"
        if anchor:
            assert anchor in anchors(target), f"{page.name}: {link}"


def test_readme_links_every_page_and_every_picture_is_shown() -> None:
    linked = {link.partition("#")[0] for link in LINK.findall((ROOT / "README.md").read_text(encoding="utf-8"))}
    assert {f"docs/{p.name}" for p in (ROOT / "docs").glob("*.md")} <= linked
    shown = {(page.parent / link).resolve() for page in PAGES for link in LINK.findall(page.read_text("utf-8"))}
    assert {p.resolve() for p in (ROOT / "docs" / "pictures").iterdir()} <= shown
    assert {p.parent.name for p in (ROOT / "docs").rglob("*.*g") if p.suffix in (".png", ".jpg")} == {"pictures"}


def test_nothing_is_cited_that_is_not_in_the_repository() -> None:
    """Names of documents and folders of a working place; a link to them is dead for everybody else."""
    words = [f"{name}.md" for name in ("DESIGN", "FORMATS", "THEORY", "FACTS", "HOUSE", "STYLE")] + ["shared" + "/"]
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    for name in filter(None, listed.stdout.decode().split("\0")):
        path = ROOT / name
        if path.suffix in (".png", ".jpg") or path == Path(__file__) or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        found = [w for w in words if w in text] + re.findall(
            r"\b(?:DESIGN|FORMATS|THEORY|FACTS|HOUSE)(?:'s| [0-9]|: [a-z\"])", text
        )
        assert not found, f"{name}: {found}"


def commands() -> Iterator[tuple[str, str]]:
    """Every command line of the pages: page, line."""
    for page, name in zip(PAGES, IDS, strict=True):
        if page.name == "CHANGELOG.md":
            continue
        text = re.sub(r"\n {8,}(?=--)", " ", page.read_text(encoding="utf-8"))  # continued lines
        for line in text.splitlines():
            if line.startswith("    "):
                found = re.search(r"(?:^ +|run: |\.venv/bin/)(perceptron-emu [a-z].*)", line)
                if found:
                    yield name, found[1].split("  #")[0].split("   ")[0]
            for inline in INLINE.findall(line):
                yield name, inline


@pytest.mark.parametrize(("page", "line"), sorted(set(commands())))
def test_command_lines_are_understood(page: str, line: str) -> None:
    """The command is there and knows the options; arguments are placeholders and not looked at."""
    from workbench.cli.app import app

    words = shlex.split(re.sub(r"[\[\]]", " ", re.sub(r"\$\(.*\)", "X", line)).replace("…", ""))
    group = typer.main.get_command(app)
    with group.make_context("perceptron-emu", [words[1], "--help"], resilient_parsing=True) as context:
        name, command, _ = group.resolve_command(context, [words[1]])  # type: ignore[attr-defined]
    assert name == words[1], f"{page}: {line}"
    if isinstance(command, TyperGroup):  # a command of several: the next word says which
        assert words[2] in command.commands, f"{page}: {line}"
        command = command.commands[words.pop(2)]
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    for word in words[2:]:
        if word.startswith("-") and len(word) > 1:
            assert word.split("=")[0] in known | {"--help"}, f"{page}: {line}: {word}"


def test_every_dependency_has_its_reason() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [d for group in (project["dependencies"], *project["optional-dependencies"].values()) for d in group]
    names = {re.split(r"[^\w-]", d)[0] for d in wanted} - {project["name"]}
    table = "\n".join(x for x in (ROOT / "docs/decisions.md").read_text("utf-8").splitlines() if x.startswith("|"))
    told = set(re.findall(r"[\w-]+", "\n".join(" ".join(row.split("|")[1:3]) for row in table.splitlines())))
    assert names <= told


def test_the_readme_s_lines_run_as_written() -> None:
    """Each of them stands in the example that the tests run, up to its comment."""
    block = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert block is not None
    example = {line.strip() for line in (ROOT / "examples/quick_start.py").read_text(encoding="utf-8").splitlines()}
    lines = [line.partition("  #")[0] for line in block[1].splitlines()]
    assert len(lines) == 3
    assert set(lines) <= example


def test_every_page_is_in_the_contents_of_the_site() -> None:
    listed = re.findall(r"^[\w/]+$", (ROOT / "docs" / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    pages = {str(p.relative_to(ROOT / "docs").with_suffix("")) for p in (ROOT / "docs").rglob("*.md")}
    assert pages - {"index"} == set(listed)
