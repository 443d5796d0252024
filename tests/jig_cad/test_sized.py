"""Sizes of a jig as unknowns, against a jig that has them."""

from __future__ import annotations

import numpy as np

from geometry import Pose, SheetPoints, exp_so3, stack_poses
from jig_cad import Jig, SizedJig


def test_predicts_what_the_resized_jig_predicts() -> None:
    rng = np.random.default_rng(1)
    jig = Jig.nominal()
    sized = SizedJig(jig)
    poses = stack_poses([
        Pose(exp_so3(np.array([0, np.pi / 2, 0])) @ exp_so3(rng.normal(size=3) * 0.2), np.array([20.0, 3.0, 290.0]))
        for _ in range(3)
    ])  # fmt: skip
    shape = (3, len(jig.strings))
    points = SheetPoints(
        rng.normal(size=(*shape, 2)),
        np.broadcast_to(np.eye(2), (*shape, 2, 2)),
        np.ones(shape, dtype=bool),
        np.broadcast_to(np.arange(len(jig.strings)), shape),
    )
    rest = np.zeros(len(jig.shape.labels))
    found = sized.predict(poses, np.concatenate([rest, [0.4, -0.7, 0.0]]), points)
    wanted = Jig.nominal(side_mm=jig.side_mm + 0.4, height_mm=jig.height_mm - 0.7).predict(poses, rest, points)
    np.testing.assert_allclose(found.residual, wanted.residual, atol=1e-10)
    more = sized.predict(poses, np.concatenate([rest, [0.41, -0.68, 0.0]]), points)
    np.testing.assert_allclose(more.residual - found.residual, found.by_shape[..., -3:-1] @ [0.01, 0.02], atol=1e-5)
    assert sized.shape.labels[-3:] == ("side_mm", "height_mm", "string_diameter_mm")


def test_a_thicker_string_has_its_axis_farther_behind_what_was_seen() -> None:
    rng = np.random.default_rng(2)
    jig = Jig.nominal(string_diameter_mm=0.3)
    turned = exp_so3(np.array([0, np.pi / 2, 0])) @ exp_so3(np.array([0.1, 0.2, 0.0]))
    pose = stack_poses([Pose(turned, np.array([20.0, 3.0, 290.0]))])
    shape = (1, len(jig.strings))
    seen, offset = rng.normal(size=(*shape, 2)), rng.normal(size=(*shape, 2)) * 0.15
    plain = (np.broadcast_to(np.eye(2), (*shape, 2, 2)), np.ones(shape, dtype=bool), np.arange(shape[1])[None])
    rest = np.zeros(len(jig.shape.labels) + 2)
    thicker = SizedJig(jig).predict(
        pose, np.append(rest, 0.2), SheetPoints(seen - offset, *plain, offset_mm=offset)
    )  # fmt: skip
    wanted = jig.predict(pose, rest[:-2], SheetPoints(seen - offset * 0.5 / 0.3, *plain))
    np.testing.assert_allclose(thicker.residual, wanted.residual, atol=1e-12)
    np.testing.assert_allclose(thicker.by_shape[..., -1], offset / 0.3, atol=1e-12)
