"""The words of help are consistent: one spelling of what is meant, one sentence each, units in names.

Does not prove that the words are true, nor that they are enough.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from workbench.cli.lazy import COMMANDS, load

WITHOUT_JSON = {"convert", "datasheet", "init", "render"}  # they write files, or words alone
PLACES = {"DATASET", "FOLDER", "RUN", "IMAGES", "PRESET", "IMAGE", "IN", "OUT", "PROFILES"}


def _walk(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    inner = getattr(command, "commands", None)
    if inner:
        for part in inner.values():
            yield from _walk(f"{name} {part.name}", part)
    else:
        yield name, command


LEAVES = [leaf for name in COMMANDS for leaf in _walk(name, load(name))]
NAMES = [name for name, _ in LEAVES]


def _options(command: Any) -> Iterator[Any]:
    return (p for p in command.params if p.param_type_name == "option" and p.name != "help")


@pytest.mark.parametrize(("name", "command"), LEAVES, ids=NAMES)
def test_every_parameter_has_one_clear_sentence(name: str, command: Any) -> None:
    assert command.help
    for p in command.params:
        if p.name == "help":
            continue
        assert p.help, f"{name} {p.name}"
        assert p.help.endswith((".", "…")), f"{name} {p.name}: {p.help}"
        assert p.help[0].isupper() or re.match(r"\w+\.(toml|csv)", p.help) or p.help.startswith("σ"), p.help
        assert len(p.help) < 240, f"{name} {p.name}"


@pytest.mark.parametrize(("name", "command"), LEAVES, ids=NAMES)
def test_arguments_are_named_in_capitals_or_by_their_file(name: str, command: Any) -> None:
    for p in command.params:
        if p.param_type_name == "argument":
            assert p.metavar, f"{name}: {p.name} has no name in its usage"
            for part in p.metavar.replace("…", "").replace("...", "").split("|"):
                assert part in PLACES or part == "FILE" or re.fullmatch(r"[A-Z]+\.(toml|csv|json)", part), part


@pytest.mark.parametrize(("name", "command"), LEAVES, ids=NAMES)
def test_one_word_for_one_thing(name: str, command: Any) -> None:
    """--json and --config say and are spelt the same wherever they are."""
    options = {p.opts[0]: p for p in _options(command)}
    assert ("--json" in options) != (name in WITHOUT_JSON)
    if "--json" in options:
        assert options["--json"].help.endswith("rint one JSON object on standard output.")
    if "--config" in options:
        assert options["--config"].opts == ["--config", "--recipe"]
        assert "The recipe" in options["--config"].help
    for p in options.values():
        text = p.opts[0]
        assert text.islower(), text
        assert not re.search(r"(?<!-)(mm|deg|px)$", text.removeprefix("--")), f"{name} {text}: a unit is its own word"
        if re.search(r"\bin (mm|degrees)\b", p.help or "") and p.nargs == 1:
            assert text.endswith(("-mm", "-deg", "-degrees")), f"{name} {text}: its unit is not in its name"


def test_the_list_of_commands_has_one_sentence_each() -> None:
    for name, text in COMMANDS.items():
        assert text.endswith((".", "?")), name
        assert len(text) <= 110, name
