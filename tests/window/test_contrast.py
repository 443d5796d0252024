"""Text stands out from its ground in both themes: the contrast of WCAG 2, at least 4.5 : 1."""

from __future__ import annotations

import re
from importlib.resources import files

import pytest

CSS = (files("workbench.window.static") / "app.css").read_text(encoding="utf-8")
LEAST = 4.5
PAIRS = [(ink, ground) for ink in ("text", "quiet") for ground in ("ground", "panel", "raised", "accent-ground")]
PAIRS += [
    ("changed", "panel"),
    ("bad", "bad-ground"),
    ("good", "good-ground"),
    ("warn", "warn-ground"),
    ("on-accent", "accent"),
]


def variables(theme: str) -> dict[str, str]:
    block = CSS.split(':root[data-theme="dark"] {')
    text = block[0] if theme == "light" else block[1].split("}")[0]
    return dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6})", text))


def luminance(colour: str) -> float:
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize(("ink", "ground"), PAIRS)
def test_contrast(theme: str, ink: str, ground: str) -> None:
    found = variables(theme)
    a, b = sorted((luminance(found[ink]), luminance(found[ground])))
    assert (b + 0.05) / (a + 0.05) >= LEAST
