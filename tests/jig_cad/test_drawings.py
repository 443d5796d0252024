"""Drawings for a workshop: the same in SVG and DXF, every hole where the jig has it, nothing beyond the sheet."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from defusedxml import ElementTree

from geometry import InputError
from jig_cad import STRINGS, Balls, Edge, Jig, Plane, Sphere, Wedge, export_target, sample_tolerance
from jig_cad.drawing import pillar_drawing
from jig_cad.drawing_targets import target_drawing
from jig_cad.paper import A3_MM, LETTER_SHARE, Paper, dxf_text, svg_text
from tests.pinned import pinned

ATOL_MM = 1e-3
BALLS = Balls.of({"first": (30, (-40, 0, 0)), "second": (30, (40, 0, 0)), "third": (20, (0, 50, 10))})
TARGETS = {
    "paper": Jig.nominal(name="paper"),
    "six strings, small": Jig.nominal(40, 60, 0.2, 0.04, tuple(STRINGS)),
    "large": Jig.nominal(400, 500, 1.0),
    "as made": sample_tolerance(Jig.nominal(), np.random.default_rng(1)),
    "sphere": Sphere(40.0),
    "large sphere": Sphere(150.0, 0.01),
    "unknown sphere": Sphere(diameter_sigma_mm=np.inf),
    "balls": BALLS,
    "plane": Plane(180.0, 140.0),
    "edge": Edge(),
    "wedge": Wedge(60.0),
    "wide wedge": Wedge(150.0, angle_known=False),
}


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_lies_beyond_the_sheet(name: str) -> None:
    """Neither lines nor, by a letter's usual width, words."""
    paper = target_drawing(TARGETS[name])
    points = np.concatenate([s.points for s in paper.shapes])
    pinned(paper)
    assert points.min() >= 0
    assert np.all(points.max(axis=0) <= A3_MM)
    for t in paper.words:
        length = LETTER_SHARE * t.height * len(t.text)
        start = {"start": 0.0, "middle": -0.5, "end": -1.0}[t.anchor] * length
        turn = np.deg2rad(t.turn_deg)
        for along in (start, start + length):
            x, y = t.x + along * np.cos(turn), t.y + along * np.sin(turn)
            assert -0.5 <= x <= A3_MM[0] + 0.5, t.text
            assert 0 <= y <= A3_MM[1], t.text


def test_a_reader_of_dxf_finds_what_the_svg_shows() -> None:
    """A reader of its own (trimesh's) sees as many circles of the same sizes, lines of the same whole length."""
    paper = pillar_drawing(Jig.nominal())
    read = trimesh.load(io.StringIO(dxf_text(paper)), file_type="dxf", process=False)
    circles = [e for e in read.entities if getattr(e, "closed", False) and type(e).__name__ == "Arc"]
    drawn = sorted(s.radius for s in paper.shapes if s.radius)
    np.testing.assert_allclose(sorted(a.center(read.vertices)["radius"] for a in circles), drawn, rtol=0, atol=ATOL_MM)
    root = ElementTree.fromstring(svg_text(paper))
    shown = [float(e.get("r")) for e in root.iter() if e.tag.endswith("circle")]
    np.testing.assert_allclose(sorted(shown), drawn, rtol=0, atol=ATOL_MM)
    lines = sum(e.length(read.vertices) for e in read.entities if type(e).__name__ == "Line")
    expected = 0.0
    for s in paper.shapes:
        if not s.radius:
            points = np.vstack([s.points, s.points[:1]]) if s.closed else s.points
            expected += float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    assert abs(lines - expected) < 0.1


def test_holes_stand_where_the_jig_has_them_at_the_stated_scale() -> None:
    """The three string holes' centres on paper form the pillar's triangle at the scale of the title block."""
    jig = Jig.nominal(120.0, 90.0)
    paper = pillar_drawing(jig)
    (scale,) = (re.match(r"1 : (\S+),", t.text) for t in paper.words if "hole 5 : 1" in t.text)
    assert scale is not None
    factor = 1 / float(scale[1])
    small = [s.points[0] for s in paper.shapes if s.layer == "hidden" and s.radius]
    assert len(small) == 3
    sides = [float(np.linalg.norm(a - b)) for k, a in enumerate(small) for b in small[:k]]
    np.testing.assert_allclose(sides, 3 * [120.0 * factor], rtol=0, atol=ATOL_MM)


def test_dimensions_and_tolerances_are_in_words() -> None:
    text = " ".join(t.text for t in pillar_drawing(Jig.nominal(100, 100, 0.3, 0.08)).words)
    for wanted in ("100 ± 0.04", "86.603 ± 0.04", "100 ± 0.02", "⌀0.6", "M5", "H7", "h6", "141.421", "ISO 2768"):
        assert wanted in text
    balls = " ".join(t.text for t in target_drawing(BALLS).words)
    assert "third" in balls
    assert "50.000" in balls


def test_the_ending_chooses_the_format(tmp_path: Path) -> None:
    export_target(Sphere(), tmp_path / "ball.svg")
    export_target(Sphere(), tmp_path / "ball.dxf")
    export_target(Jig.nominal(), tmp_path / "jig.dxf")
    assert (tmp_path / "jig.dxf").read_text().endswith("EOF\n")
    assert (tmp_path / "ball.dxf").read_text().isascii()
    with pytest.raises(InputError, match=r"\.svg, \.dxf") as refused:
        export_target(Sphere(), tmp_path / "ball.stl")
    pinned(str(refused.value).replace(str(tmp_path), ""))
    lines = Jig.of_lines({"a": (0, 0, 0), "b": (90, 5, 20)}, {"left": ("a", "b")})
    with pytest.raises(InputError, match="needs a triangular pillar") as refused:
        export_target(lines, tmp_path / "lines.svg")
    pinned(str(refused.value).replace(str(tmp_path), ""))


def test_notes_point_at_what_they_speak_of(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tip of every note of a jig's drawing is on a line of a part to a hundredth of a millimetre of paper."""
    tips: list[tuple[np.ndarray, str]] = []
    leader = Paper.leader

    def noted(paper: Paper, tip: np.ndarray, knee: np.ndarray, text: str) -> None:
        tips.append((np.asarray(tip), text))
        leader(paper, tip, knee, text)

    monkeypatch.setattr(Paper, "leader", noted)
    paper = target_drawing(TARGETS["paper"])
    assert len(tips) >= 4
    for tip, text in tips:
        near = []
        for s in (s for s in paper.shapes if s.layer not in ("dim", "axis", "frame")):
            if s.radius:
                near.append(abs(np.linalg.norm(s.points[0] - tip) - s.radius))
                continue
            ends = np.concatenate([s.points, s.points[:1]]) if s.closed else s.points
            a, b = ends[:-1], ends[1:]
            along = np.clip(np.sum((tip - a) * (b - a), axis=1) / np.maximum(np.sum((b - a) ** 2, axis=1), 1e-12), 0, 1)
            near.append(np.linalg.norm(tip - a - along[:, None] * (b - a), axis=1).min())
        assert min(near) < 0.01, text
