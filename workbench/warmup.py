"""Compile the numeric kernels once, when setting up: strings, surfaces and gaps rendered and measured, a cell solved.

What is not run here is compiled by the first command that needs it. Two processes share the work.
"""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from geometry import Pose, inside_polygon

PANELS = {
    "wall": Pose.from_fixed_xyz_deg((0.0, 0.0, 90.0), (0.0, 0.0, 310.0)),
    "floor": Pose.from_fixed_xyz_deg((0.0, 60.0, 0.0), (0.0, 0.0, 330.0)),
}
STRIPES = ("lamp", "clipped_below_full_scale", "pair_1.5", "dashes", "on_blotches", "scratched_metal")


def main() -> None:
    """Run every compiled stage of the chain; the compiled code is kept beside the modules for later starts."""
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        for stage in [pool.submit(stage) for stage in (measure_stripes, emulate, measure_strings)]:
            stage.result()
    measure_gap()


def emulate() -> None:
    """Render strings before bodies, surfaces with bounces, light below them, a bent lens, and light without speckle."""
    import assets
    from perceptron_emu import Material, Scene, panel, render
    from workbench.cell import jig_bodies
    from workbench.files import read_cell

    cell = read_cell(assets.path("samples", "cell_a"))
    T_sensor_jig = Pose.from_fixed_xyz_deg((5.0, 10.0, 0.0), (-50.0, 0.0, 330.0))
    bodies = tuple(type(s)(s.mesh, s.material, T_sensor_jig @ s.T_sensor_mesh, s.name) for s in jig_bodies(cell.jig))
    render(Scene(cell.sensor, cell.jig, T_sensor_jig, bodies), cell.emulator, np.random.default_rng(0))
    wall, floor = (panel(120.0, 120.0, pose, Material(0.5), name) for name, pose in PANELS.items())
    changes = {
        "light": cell.emulator.light.model_copy(update={"bounces": True}),
        "speckle": cell.emulator.speckle.model_copy(update={"enabled": False}),
    }
    bouncing = cell.emulator.model_copy(update={"light": changes["light"]})
    render(Scene(cell.sensor, cell.jig, T_sensor_jig, (wall, floor)), bouncing, np.random.default_rng(0))
    skin = panel(120.0, 120.0, PANELS["floor"], Material(0.5, scatter_mm=0.3), "skin")
    bent = cell.sensor.with_camera(distortion=(-0.1, 0.05, 0.0, 0.0, 0.0))
    render(Scene(bent, solids=(skin,)), cell.emulator.model_copy(update=changes), np.random.default_rng(0))


def measure_strings() -> None:
    """Calibrate a recorded cell; find spots two of which are nearly one, and spots of a stack."""
    import assets
    from extraction import extract
    from extraction.spots import fit_stack
    from workbench.cell import observe, solve
    from workbench.files import read_cell

    cell = read_cell(assets.path("samples", "cell_a"))
    solve(cell, observe(cell))
    image = _pairs_of_spots(cell.sensor.require_camera().shape)
    extract(image, cell.sensor)
    fit_stack(image[None, 490:511, 190:211].astype(float), 1.0)
    inside_polygon(np.zeros((1, 2)), np.eye(3, 2))


def measure_stripes() -> None:
    """Find stripes that are clipped, two, broken, faint and none, in images of 8 and of 16 bits."""
    from extraction import StripeConfig, detect_stripe
    from extraction.stripe.pictures import draw

    for kind in STRIPES:
        image = draw(kind, np.random.default_rng(3)).image
        for grey in (image, image.astype(np.uint16)):  # compiled for both: what is not of 8 bits is 32 bits wide inside
            detect_stripe(grey, StripeConfig(along_normal=True))
    detect_stripe(draw("lit_board", np.random.default_rng(1)).image)  # full of other ridges


def _pairs_of_spots(shape: tuple[int, int]) -> np.ndarray:
    """Bright spots in twos, from hardly apart to well apart."""
    v, u = np.ogrid[: shape[0], : shape[1]]
    grey = np.full(shape, 4.0)
    for k, apart in enumerate(np.linspace(2.0, 7.0, 8)):
        for at in (u - 200.0 - 100 * k, u - 200.0 - 100 * k - apart):
            grey += 150.0 * np.exp(-0.5 * (at**2 + (v - 500.0) ** 2) / 2.0)
    return np.random.default_rng(0).poisson(grey).clip(0, 255).astype(np.uint8)


def measure_gap() -> None:
    """Measure gap and flush of two rendered panels."""
    import assets
    from extraction import extract_profile, measure_gap_flush
    from perceptron_emu import Scene, render
    from perceptron_emu.solids import PanelPair
    from workbench.files import read_cell

    cell = read_cell(assets.path("samples", "cell_a"))
    solids = PanelPair(3.0, 0.5).solids(Pose.from_fixed_xyz_deg((0.0, 0.0, 0.0), (0.0, 0.0, 300.0)))
    image = render(Scene(cell.sensor, None, solids=solids), cell.emulator, np.random.default_rng(0)).image
    measure_gap_flush(extract_profile(image, cell.sensor))


if __name__ == "__main__":
    main()
