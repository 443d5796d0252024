"""Compile the numeric kernels once, when setting up: strings and a stripe rendered and extracted, a cell calibrated."""

from __future__ import annotations

import numpy as np

from geometry import Pose

PANELS = {
    "wall": Pose.from_fixed_xyz_deg((0.0, 0.0, 90.0), (0.0, 0.0, 310.0)),
    "floor": Pose.from_fixed_xyz_deg((0.0, 60.0, 0.0), (0.0, 0.0, 330.0)),
}


def main() -> None:
    """Run every compiled stage of the chain; the compiled code is kept beside the modules for later starts."""
    import assets
    from extraction import extract_profile
    from perceptron_emu import Material, Scene, panel, render
    from workbench.cell import jig_bodies, observe, solve
    from workbench.files import read_cell

    cell = read_cell(assets.path("samples", "cell_a"))
    T_sensor_jig = Pose.from_fixed_xyz_deg((5.0, 10.0, 0.0), (-50.0, 0.0, 330.0))
    bodies = tuple(type(s)(s.mesh, s.material, T_sensor_jig @ s.T_sensor_mesh, s.name) for s in jig_bodies(cell.jig))
    render(Scene(cell.sensor, cell.jig, T_sensor_jig, bodies), cell.emulator, np.random.default_rng(0))
    solve(cell, observe(cell))
    wall, floor = (panel(120.0, 120.0, pose, Material(0.5), name) for name, pose in PANELS.items())
    light = cell.emulator.light.model_copy(update={"bounces": True})
    bouncing = cell.emulator.model_copy(update={"light": light})
    frame = render(Scene(cell.sensor, solids=(wall, floor)), bouncing, np.random.default_rng(0))
    extract_profile(frame.image, cell.sensor)


if __name__ == "__main__":
    main()
