"""What all nouns of the packages have in common: they do not change, and what they are by default may be asked for."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from calib import CalibConfig
from extraction import ExtractionConfig, StripeConfig
from perceptron_emu import EmulatorConfig

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("geometry", "jig_cad", "extraction", "calib", "perceptron_emu")
FILLED = ("geometry/robot/inverse_kinematics.py: _Search", "jig_cad/paper.py: Paper")  # as their work goes on


def _dataclasses() -> list[tuple[str, str]]:
    """Of every dataclass its place and its decorator."""
    found = []
    for file in (f for p in PACKAGES for f in sorted((ROOT / p).rglob("*.py"))):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                said = [ast.unparse(d) for d in node.decorator_list]
                found += [(f"{file.relative_to(ROOT)}: {node.name}", s) for s in said if s.startswith("dataclass")]
    return found


def test_nouns_do_not_change() -> None:
    changing = [place for place, said in _dataclasses() if "frozen=True" not in said]
    assert len(_dataclasses()) > 200
    assert changing == list(FILLED)


@pytest.mark.parametrize("model", [CalibConfig, ExtractionConfig, StripeConfig, EmulatorConfig])
def test_what_is_so_by_default_may_be_asked_for(model) -> None:  # type: ignore[no-untyped-def]
    """A default is not checked where it stands: it lies within its own limits all the same."""
    assert model.model_validate(model().model_dump()) == model()
