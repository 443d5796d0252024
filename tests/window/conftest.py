"""A small emulated cell with truth: 28 images of 640 × 512 at four locations, rendered once a session."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from geometry import Pose, draw_errors
from jig_cad import Jig, sample_tolerance
from perceptron_emu import EmulatorConfig
from workbench import defaults
from workbench.cell import DESIGN_SCP, PLACES, find_robot, find_sensor, jig_bodies, place_of_jig, wall_behind
from workbench.emulate import TrueCell, record, with_joint_noise
from workbench.files import Cell
from workbench.plan import ViewLimits, ViewProblem, plan_views

SEED = 5
EMULATION = {"exposure": {"time_ms": 0.8}, "laser": {"power_mw": 6.0}}


@pytest.fixture(scope="session")
def cell_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset's folder; tests that change it take a copy."""
    folder = tmp_path_factory.mktemp("cell")
    rng = np.random.default_rng(SEED)
    big = find_sensor(defaults.SENSOR)
    half = {k: getattr(big.camera, k) / 2 for k in ("fx_px", "fy_px", "cx_px", "cy_px")}
    sensor = replace(big.with_camera(width_px=640, height_px=512, **half), optics=None)
    jig = Jig.nominal()
    true_jig = sample_tolerance(jig, rng)
    mounted = Pose.from_fixed_xyz_deg((-1.5, 1.6, 22.5), (-16.9, -75.5, 116.5))
    robot = find_robot(defaults.ROBOT)
    places = {name: place_of_jig(*place[1:]) for name, place in PLACES.items()}
    bodies = jig_bodies(true_jig)
    solids = {n: bodies if n in "AC" else (*bodies, wall_behind(true_jig, 120.0)) for n in places}
    views = []
    for name, pose in places.items():
        planned = plan_views(ViewProblem(robot, sensor, jig, pose, DESIGN_SCP, ViewLimits()), 7, rng)
        views += [(name, PLACES[name][0], joints) for joints in planned.joints_rad]
    cell = Cell(
        folder=folder,
        sensor=sensor,
        target=jig,
        robot=robot,
        frames=(),
        T_hand_sensor_design=DESIGN_SCP,
        name="test cell",
        emulator=EmulatorConfig.model_validate(EMULATION),
    )
    true = TrueCell(robot.corrected(draw_errors(robot, rng)), true_jig, mounted, places, solids)
    record(folder, cell, true, with_joint_noise(views, true.robot, rng), SEED)
    return folder


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Headless Chromium, started once."""
    from tests.window.chromium import chromium

    yield from chromium(tmp_path_factory.mktemp("profile"))
