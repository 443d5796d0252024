"""Images of balls and plates: stripes where the truth says that the body is, solved like any others."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from jig_cad import Balls, Edge, Plane, Sphere, Wedge
from jig_cad.bodies import target_meshes
from tests.workbench.helpers import Cli
from workbench.files import read_cell


@pytest.mark.parametrize(
    "target",
    [
        Sphere(25.4),
        Balls.of({"a": (20.0, (0, 0, 0)), "b": (30.0, (60, 10, 5))}),
        Plane(),
        Edge(),
        Wedge(angle_deg=100.0),
    ],
    ids=lambda t: t.kind,
)
def test_a_body_is_where_its_target_says(target: Sphere | Balls | Plane | Edge | Wedge) -> None:
    """Corners of the mesh lie on the target's surface; what has an outside is turned outwards."""
    for k, mesh in enumerate(target_meshes(target).values()):
        feature = np.full(len(mesh.vertices), k)
        if isinstance(target, Edge):
            assert np.all(mesh.vertices[:, 1] <= 0)
            assert np.all(mesh.vertices[:, 2] == 0)
            continue
        distance, gradient = target.offset(np.asarray(mesh.vertices), feature)
        assert np.abs(distance).max() < 2e-4 * 15.0  # of the larger ball's radius
        assert np.sum(mesh.vertex_normals * gradient[:, 0], axis=1).min() > 0.99


def test_images_of_a_ball_show_it_where_the_truth_has_it(cli: Cli, tmp_path: Path) -> None:
    """Every point of the stripe is a radius from the true centre, as far as its σ says."""
    assert cli("init", tmp_path / "ball", "--target", "sphere").code == 0
    out = tmp_path / "out"
    assert cli("render", tmp_path / "ball", "--out", out, "--per-location", 1, "--seed", 2).code == 0
    cell = read_cell(out)
    assert isinstance(cell.target, Sphere)
    assert cell.truth is not None
    assert len(cell.truth.frames) == 4
    misses = []
    for frame in cell.truth.frames:
        answer = cli("profile", out / "images" / f"{frame.frame:03d}.png", "--sensor", out / "sensor.toml", "--json")
        points = [p for p in json.loads(answer.out)["images"][0]["points"] if not p["flag"]]
        centre = np.array(frame.T_sensor_jig)[:3, 3]
        yz = np.array([[p["y_mm"], p["z_mm"]] for p in points])
        outwards = np.column_stack([np.full(len(yz), -centre[0]), yz - centre[1:]])
        distance = np.linalg.norm(outwards, axis=1)
        slope = outwards[:, 2] / distance  # of the distance by z, along which nearly all of a point's σ lies
        sigma = np.abs(slope) * [p["sigma_z_mm"] for p in points]
        misses.append((distance - cell.target.diameter_mm / 2) / np.maximum(sigma, 1e-3))
    every = np.concatenate(misses)
    assert len(every) > 300
    assert 0.6 < np.sqrt(np.mean(every**2)) < 1.5
