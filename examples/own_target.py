"""A target of your own, from outside the packages: a cylinder of known radius, every stripe point lies on it.

Its images are made by the emulator from a mesh that knows nothing of ``offset``, its points by extraction; the answer
is held against the truth. All that a target needs is its distance from a point and what of its pose can be seen.
"""

import numpy as np
import trimesh

from calib import CalibConfig, calibrate
from extraction import extract_profile
from geometry import AxisPoints, Frame, Pose, Surface, draw_errors, exp_so3, inverse_kinematics
from perceptron_emu import Scene, Solid, render
from workbench.cell import find_emulator, find_robot, find_sensor


class Cylinder(Surface):
    """A cylinder about the x axis of its own frame; a shift along x and a turn about it do not show."""

    freedom = (False, True, True, False, True, True)

    def __init__(self, radius_mm: float) -> None:
        self.radius_mm = radius_mm

    def offset(self, points_mm, feature):
        """Signed distance (N, 1) of points (N, 3) from the surface, and its gradient (N, 1, 3)."""
        across = points_mm * [0.0, 1.0, 1.0]
        length = np.linalg.norm(across, axis=1, keepdims=True)
        return length - self.radius_mm, (across / length)[:, None, :]


def main() -> float:
    """Emulate, extract, calibrate; return the squared error in σ of the six numbers (6 on average)."""
    rng = np.random.default_rng(5)
    sensor, robot = find_sensor("nominal"), find_robot("abb_irb6640_180_255")
    design = Pose.from_fixed_xyz_deg((0, 0, 20), (-17, -76, 117))
    truth = design @ Pose.exp(np.array([0.5, -0.7, 0.4, 0.01, -0.01, 0.015]))
    built = robot.corrected(draw_errors(robot, rng))  # the arm as it is, not as its table says
    target, pipe = Cylinder(25.0), trimesh.creation.cylinder(25.0, 300.0, sections=512)
    along_x = Pose(exp_so3(np.array([0.0, np.pi / 2, 0.0])), np.zeros(3))  # the mesh's axis is z
    upright = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
    places = {k: Pose(upright, np.array([1600.0, y, 900.0])) for k, y in (("A", -450.0), ("B", 0.0), ("C", 450.0))}
    places["C"] = places["C"] @ Pose(exp_so3(np.array([0.0, 0.0, 1.2])), np.zeros(3))  # one of them lies
    # speckle off: how it ties neighbours along a stripe is not in a profile's σ
    camera = find_emulator("nominal").off("speckle")
    frames: list[Frame] = []
    for location, T_base_target in places.items():
        while sum(f.location == location for f in frames) < 9:
            tilt = np.deg2rad(rng.uniform([-40, -25, -25], [40, 25, 25]))
            view = Pose(exp_so3(tilt), exp_so3(tilt) @ [0.0, 0.0, -305.0] + rng.uniform(-10, 10, 3))  # T_target_sensor
            found = inverse_kinematics(robot, T_base_target @ view @ design.inverse(), rng)
            if not found.converged:
                continue
            q = found.joints + rng.normal(size=6) * robot.dh_part().uncertainty.joint_sigma_rad
            T_sensor_target = (built.pose(q) @ truth).inverse() @ T_base_target
            solid = Solid(pipe, T_sensor_mesh=T_sensor_target @ along_x)
            profile = extract_profile(render(Scene(sensor, solids=(solid,)), camera, rng).image, sensor)
            n = len(profile)
            middle = profile[np.linspace(0.2 * n, 0.8 * n, 40).astype(int)]  # not the rim, where light grazes
            axis = AxisPoints(("surface",) * 40, np.full(40, -1), middle.yz_mm, middle.cov_yz_mm2, ("",) * 40)
            frames.append(Frame(len(frames), location, joints_rad=found.joints, axis=axis, labels_given=True))
    roughly = {
        name: place @ Pose.exp(rng.normal(size=6) * [5, 5, 5, 0.02, 0.02, 0.02]) for name, place in places.items()
    }
    result = calibrate(frames, target, robot, sensor, design, roughly, CalibConfig(model="full"))
    error = (result.T_hand_sensor.inverse() @ truth).log()
    print(f"verdict: {result.verdict.code}, χ² per degree of freedom {result.chi2_per_dof:.2f}")
    print(f"error {np.round(error[:3], 3)} mm, σ {np.round(np.sqrt(np.diag(result.covariance))[:3], 3)} mm")
    return float(error @ np.linalg.solve(result.covariance, error))


if __name__ == "__main__":
    print(f"squared error in σ: {main():.1f} (6 on average)")
