"""Compile the numeric kernels once, as part of setting up: one frame rendered, the sample extracted and calibrated."""

from __future__ import annotations

import numpy as np


def main() -> None:
    """Run every compiled stage of the chain; the compiled code is kept beside the modules for later starts."""
    import assets
    from geometry import Pose
    from perceptron_emu import Scene, render
    from workbench.cell import jig_bodies, observe, solve
    from workbench.files import read_cell

    cell = read_cell(assets.path("samples", "cell_a"))
    T_sensor_jig = Pose.from_fixed_xyz_deg((5.0, 10.0, 0.0), (-50.0, 0.0, 330.0))
    bodies = tuple(type(s)(s.mesh, s.material, T_sensor_jig @ s.T_sensor_mesh, s.name) for s in jig_bodies(cell.jig))
    render(Scene(cell.sensor, cell.jig, T_sensor_jig, bodies), cell.emulator, np.random.default_rng(0))
    solve(cell, observe(cell))


if __name__ == "__main__":
    main()
