"""Where the jig's posts may stand: in how many views they hide a string from the laser or the camera.

Views: the sensor 320 mm in front of the pillar, its sheet through the pillar's middle third, swung sideways, tilted up
or down and rolled. A post is a vertical cylinder, so what hides what is a question of the plan (y, z).
Run: python benchmarks/jig_posts.py
"""

from __future__ import annotations

import numpy as np

from geometry import Pose, cross_plane_x0
from jig_cad import Jig
from jig_cad.solids import PillarDesign

STAND_OFF_MM, BASE_MM = 320.0, 120.0
SWINGS_DEG = {"swing to 20°": 20.0, "swing to 35°": 35.0, "swing to 50°": 50.0, "swing to 70°": 70.0}
CLEARANCE_MM = 1.0  # a lit spot and the sheet have a width
VIEWS = 4000


def views(jig: Jig, swing_deg: float, rng: np.random.Generator) -> Pose:
    """T_jig_sensor (N) of random views from the front: swing about x, tilt ±30°, roll ±40° and half of them turned."""
    swing, tilt, roll = (rng.uniform(-limit, limit, VIEWS) for limit in (swing_deg, 30.0, 40.0))
    roll += 180.0 * rng.integers(0, 2, VIEWS)
    zero = np.zeros(VIEWS)
    turn = Pose.from_fixed_xyz_deg(np.column_stack([swing, zero, zero]), np.zeros((VIEWS, 3)))
    turn = turn @ Pose.from_fixed_xyz_deg(np.column_stack([zero, tilt, zero]), np.zeros((VIEWS, 3)))
    turn = turn @ Pose.from_fixed_xyz_deg(np.column_stack([zero, zero, roll]), np.zeros((VIEWS, 3)))
    h, depth = jig.height_mm, np.sqrt(3) / 2 * jig.side_mm
    target = np.column_stack([rng.uniform(h / 3, 2 * h / 3, VIEWS), zero, np.full(VIEWS, depth / 2)])
    return Pose(turn.R, target - STAND_OFF_MM * turn.R[:, :, 2])


def hidden(jig: Jig, T_jig_sensor: Pose, posts_yz: np.ndarray, radius_mm: float) -> tuple[float, float]:
    """Shares of views with a string hidden by a post, and of views in which all strings cross the sheet at all."""
    T_sensor_jig = T_jig_sensor.inverse()
    start = T_sensor_jig @ np.broadcast_to(jig.starts, (VIEWS, *jig.starts.shape))
    along = (T_sensor_jig.R[:, None] @ (jig.ends - jig.starts)[..., None])[..., 0]
    crossing, s = cross_plane_x0(start, along)
    usable = np.all((s > 0.03) & (s < 0.97), axis=1)
    points = (T_jig_sensor @ crossing)[..., 1:]
    blocked = np.zeros(VIEWS, dtype=bool)
    for eye in (np.zeros(3), np.array([BASE_MM, 0, 0])):
        source = (T_jig_sensor @ np.broadcast_to(eye, (VIEWS, 3)))[:, None, 1:]
        ray = points - source
        for post in posts_yz:
            t = np.clip(np.sum((post - source) * ray, -1) / np.sum(ray**2, -1), 0, 1)
            distance = np.linalg.norm(source + t[..., None] * ray - post, axis=-1)
            blocked |= np.any(distance < radius_mm + CLEARANCE_MM, axis=1)
    return float(np.mean(blocked[usable])), float(np.mean(usable))


def main() -> None:
    """Print a table of arrangements."""
    jig, design = Jig.nominal(), PillarDesign()
    a, depth, r = jig.side_mm, np.sqrt(3) / 2 * jig.side_mm, design.post_diameter_mm / 2
    arrangements = {
        "three, 15 mm outside the edges' middles": np.array([[0, depth + 15], [-38, 35.8], [38, 35.8]]),
        "two, beside string A": np.array([[-20.0, 0], [20, 0]]),
        "two, beside B and C (y ± 20)": np.array([[-a / 2 - 20, depth], [a / 2 + 20, depth]]),
        "two, behind B and C (z + 20)": np.array([[-a / 2, depth + 20], [a / 2, depth + 20]]),
        "two, behind and outside (the design)": design.posts_yz(jig),
    }
    print(f"share of views with a string hidden by a post of {2 * r:g} mm")
    print(f"{'posts':44}" + "".join(f"{name:>15}" for name in SWINGS_DEG))
    for name, posts in arrangements.items():
        shares = [hidden(jig, views(jig, swing, np.random.default_rng(1)), posts, r) for swing in SWINGS_DEG.values()]
        print(f"{name:44}" + "".join(f"{share:15.3f}" for share, _ in shares))


if __name__ == "__main__":
    main()
