"""Solids are closed, of the right volume and in the right place; exports hold the same; the drawing says the same."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from defusedxml import ElementTree
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry import InputError
from jig_cad import ANCHORS, STRINGS, Jig, PillarDesign, drawing_svg, export_jig, jig_solids, sample_tolerance
from tests.pinned import pinned

SIX = tuple(STRINGS)


def plate_volume(jig: Jig, design: PillarDesign, holes: int) -> float:
    """Steiner's formula for the hull of holes and posts widened by the margin, less the holes, times the thickness."""
    (_, z), (y, _) = design.posts_yz(jig)
    half, depth, m = jig.side_mm / 2, np.sqrt(3) / 2 * jig.side_mm, design.plate_margin_mm
    corners = [(0.0, 0.0), (half, depth), (y, z), (-y, z), (-half, depth)]
    hull = trimesh.path.polygons.Polygon(corners).convex_hull  # B and C may lie inside it
    area = hull.area + hull.length * m + np.pi * m**2 - holes * np.pi / 4 * design.hole_mm(jig) ** 2
    return float(area * design.plate_thickness_mm)


@given(st.floats(40, 300), st.floats(40, 300), st.floats(0.05, 2.0), st.integers(0, 2**32 - 1), st.booleans())
@settings(max_examples=15, deadline=None)
def test_solids_are_closed_and_of_the_right_volume(
    side_mm: float, height_mm: float, diameter_mm: float, seed: int, six: bool
) -> None:
    """Arcs are polygons of 64 sides (24 for strings): 0.2 % less area than a circle, 1.2 % for strings."""
    jig = Jig.nominal(side_mm, height_mm, diameter_mm, strings=SIX if six else SIX[:5])
    jig, design = sample_tolerance(jig, np.random.default_rng(seed)), PillarDesign()
    solids = jig_solids(jig, design)
    assert len(solids) == 2 + 2 + len(jig.strings)
    for name, mesh in solids.items():
        assert mesh.is_watertight, name
        assert mesh.is_volume, name
    for plate in ("bottom plate", "top plate"):
        np.testing.assert_allclose(solids[plate].volume, plate_volume(jig, design, 3), rtol=5e-4)
    post = np.pi / 4 * design.post_diameter_mm**2 * height_mm
    np.testing.assert_allclose(solids["post 1"].volume, post, rtol=2e-3)
    rods = dict(zip(jig.strings, jig.lengths, strict=True))
    for label, length in rods.items():
        beyond = {"A": 20.0, "B": 20.0, "C": 20.0, "D'": 0.4 * diameter_mm}.get(label, 0.0)
        volume = np.pi / 4 * diameter_mm**2 * (length + beyond)
        np.testing.assert_allclose(solids[f"string {label}"].volume, volume, rtol=1.3e-2)


def test_strings_leave_the_centres_of_the_holes() -> None:
    """At the inner faces: nothing of the plate within the hole's radius around each anchor, plate right outside it."""
    jig = sample_tolerance(Jig.nominal(strings=SIX, tolerance_mm=2.0), np.random.default_rng(1))
    solids, design = jig_solids(jig), PillarDesign()
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.column_stack([np.zeros(12), np.cos(angles), np.sin(angles)])
    for i, anchor in enumerate(ANCHORS):
        plate = solids["top plate" if anchor.endswith("t") else "bottom plate"]
        inside = np.array([5.0 if anchor.endswith("t") else -5.0, 0, 0])  # the middle of the plate's thickness
        near = jig.anchors_mm[i] + inside + ring * design.hole_mm(jig) / 2 * 0.97
        far = jig.anchors_mm[i] + inside + ring * design.hole_mm(jig) / 2 * 1.03
        assert not np.any(plate.contains(near)), anchor
        assert np.all(plate.contains(far)), anchor


def test_a_jig_measured_far_from_its_drawing_keeps_its_holes_in_the_plates() -> None:
    jig = Jig.nominal()
    anchors = jig.anchors_mm + np.array([0, 0, -30.0]) * (np.arange(6) < 2)[:, None]
    moved = replace(jig, anchors_mm=anchors, measured=True)
    solids = jig_solids(moved)
    assert all(m.is_volume for m in solids.values())
    assert solids["bottom plate"].euler_number == jig_solids(jig)["bottom plate"].euler_number == 2 - 2 * 3


def test_plates_are_held_apart_by_the_height_and_posts_touch_both() -> None:
    solids = jig_solids(Jig.nominal(height_mm=120.0))
    assert solids["bottom plate"].bounds[:, 0].tolist() == [-10.0, 0.0]
    assert solids["top plate"].bounds[:, 0].tolist() == [120.0, 130.0]
    assert solids["post 2"].bounds[:, 0].tolist() == [0.0, 120.0]
    assert set(jig_solids(Jig.nominal(), strings=False, posts=False)) == {"bottom plate", "top plate"}


def test_posts_hide_no_string_from_the_front() -> None:
    """Rays from 320 mm in front, swung to 60° on either side, to every string reach it past the posts."""
    jig = Jig.nominal(strings=SIX)
    solids = jig_solids(jig, strings=False)
    swing = np.deg2rad(np.arange(-60, 61, 5))
    eyes = np.column_stack([np.full(len(swing), 50.0), 320 * np.sin(swing), 43 - 320 * np.cos(swing)])
    goals = (jig.starts + jig.ends) / 2
    start = np.repeat(eyes, len(goals), axis=0)
    ray = np.tile(goals, (len(eyes), 1)) - start
    posts = trimesh.util.concatenate([solids["post 1"], solids["post 2"]])
    hit, index, _ = posts.ray.intersects_location(start, ray, multiple_hits=False)
    before = np.linalg.norm(hit - start[index], axis=1) < np.linalg.norm(ray[index], axis=1)
    assert len(hit) > 0  # the posts are there: rays that go on behind the strings do hit them
    assert not np.any(before)


@pytest.mark.parametrize("strings", [SIX, SIX[:5], ("A",)])
def test_stl_and_glb_hold_the_solids(tmp_path: Path, strings: tuple[str, ...]) -> None:
    jig = Jig.nominal(strings=strings)
    volume = sum(m.volume for m in jig_solids(jig).values())
    export_jig(jig, tmp_path / "jig.stl")
    export_jig(jig, tmp_path / "jig.GLB")
    stl = trimesh.load_mesh(tmp_path / "jig.stl")
    assert stl.is_watertight
    assert stl.body_count == 4 + len(strings)
    np.testing.assert_allclose(stl.volume, volume, rtol=1e-5)
    np.testing.assert_allclose(stl.bounds[:, 0], [-10, 110], rtol=0, atol=1e-4)
    scene = trimesh.load_scene(tmp_path / "jig.GLB")
    assert set(scene.geometry) == set(jig_solids(jig))
    assert all(m.is_watertight for m in scene.geometry.values())
    np.testing.assert_allclose(scene.geometry["string A"].bounds[:, 0], [-10, 110], rtol=0, atol=1e-4)
    # glTF: metres, Y up, the viewer at +Z sees the front
    np.testing.assert_allclose(scene.bounds[:, 1], [-0.01, 0.11], rtol=0, atol=1e-7)
    np.testing.assert_allclose(scene.bounds[1, 2], 0.008, rtol=0, atol=1e-4)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["jig.GLB", "jig.stl"]


def test_the_drawing_names_every_hole_with_its_coordinates(tmp_path: Path) -> None:
    jig = sample_tolerance(Jig.nominal(strings=SIX, name="<six> & co"), np.random.default_rng(3))
    root = ElementTree.fromstring(drawing_svg(jig))
    text = " ".join(e.text or "" for e in root.iter())
    for i, anchor in enumerate(ANCHORS):
        row = next(e.text for e in root.iter() if (e.text or "").startswith(anchor))
        assert row.split()[1:4] == [f"{v:.3f}" for v in jig.anchors_mm[i]]
    assert "± 0.05 mm" in text
    assert "86.603" in text
    assert "<six> & co" in text
    export_jig(jig, tmp_path / "jig.svg")
    assert (tmp_path / "jig.svg").read_text() == drawing_svg(jig)


def test_what_can_not_be_built_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean") as refused:
        export_jig(Jig.nominal(), tmp_path / "jig.st")
    pinned(str(refused.value).replace(str(tmp_path), ""))
    with pytest.raises(InputError, match="can not be written") as refused:
        export_jig(Jig.nominal(), tmp_path / "none" / "jig.stl")
    pinned(str(refused.value).replace(str(tmp_path), ""))
    with pytest.raises(InputError, match="hole_diameter_mm") as refused:
        jig_solids(Jig.nominal(), PillarDesign(hole_diameter_mm=0.2))
    pinned(str(refused.value).replace(str(tmp_path), ""))
    with pytest.raises(InputError, match="plate_thickness_mm") as refused:
        replace(PillarDesign(), plate_thickness_mm=0.0)
    pinned(str(refused.value).replace(str(tmp_path), ""))
