"""Distances of segments and boxes from boxes: against dense points, and where they meet."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry import Pose, box_edges, box_to_boxes_mm, segments_to_boxes_mm

ATOL_MM = 1e-9
STEPS = 4001


def _to_box(points: np.ndarray, box: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points - np.clip(points, box[0], box[1]), axis=-1)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_a_segments_distance_is_that_of_its_nearest_point(seed: int) -> None:
    """Dense points can only be farther, and by no more than half their spacing."""
    rng = np.random.default_rng(seed)
    box = np.sort(rng.uniform(-50, 50, (2, 3)), axis=0)
    a, b = rng.uniform(-100, 100, (2, 3))
    if seed % 3 == 0:
        b[rng.integers(3)] = a[0]  # parallel to a face, now and then
    said = float(segments_to_boxes_mm(a, b, box[None])[0])
    dense = float(_to_box(a + np.linspace(0, 1, STEPS)[:, None] * (b - a), box).min())
    assert dense - np.linalg.norm(b - a) / (STEPS - 1) <= said <= dense + ATOL_MM


def test_a_segment_through_a_box_touches_it() -> None:
    box = np.array([[[-1.0, -1, -1], [1, 1, 1]]])
    crossing = segments_to_boxes_mm(np.array([[-5.0, 0, 0], [3.0, 0, 0]]), np.array([[5.0, 0, 0], [7.0, 0, 0]]), box)
    np.testing.assert_allclose(crossing[:, 0], [0, 2], rtol=0, atol=ATOL_MM)


def test_a_point_is_a_segment_without_length() -> None:
    box = np.array([[[-1.0, -1, -1], [1, 1, 1]]])
    p = np.array([[4.0, 5.0, 0.0]])
    np.testing.assert_allclose(segments_to_boxes_mm(p, p, box), [[5.0]], rtol=0, atol=ATOL_MM)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_boxes_are_as_far_as_their_nearest_points(seed: int) -> None:
    """Points on the surface of a turned box can only be farther from the others than said, and not by much."""
    rng = np.random.default_rng(seed)
    box = np.array([[-20.0, -30, -40], [20, 30, 40]])
    others = np.stack([np.sort(rng.uniform(-100, 100, (2, 3)), axis=0) for _ in range(2)])
    pose = Pose.exp(np.concatenate([rng.uniform(-120, 120, 3), rng.normal(size=3)]))
    said = box_to_boxes_mm(Pose(pose.R[None], pose.t[None]), box, others)[0]
    grid = np.stack(np.meshgrid(*[np.linspace(a, b, 41) for a, b in box.T], indexing="ij"), -1).reshape(-1, 3)
    for distance, other in zip(said, others, strict=True):
        dense = float(_to_box(pose @ grid, other).min())
        assert dense - 2.0 <= distance <= dense + ATOL_MM


def test_a_box_within_another_touches_it() -> None:
    small, large = np.array([[-1.0] * 3, [1.0] * 3]), np.array([[[-9.0] * 3, [9.0] * 3]])
    here = Pose(np.eye(3)[None], np.zeros((1, 3)))
    assert box_to_boxes_mm(here, small, large)[0, 0] == 0
    assert box_to_boxes_mm(here, large[0], small[None])[0, 0] == 0


def test_a_box_has_twelve_edges() -> None:
    edges = box_edges(np.array([[0.0, 0, 0], [1, 2, 3]]))
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=-1)
    assert sorted(lengths.tolist()) == [1.0] * 4 + [2.0] * 4 + [3.0] * 4
