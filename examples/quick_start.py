"""From an empty page to a solved sensor centre position: emulate 14 frames, extract, calibrate, compare with truth."""

import numpy as np

from calib import calibrate
from extraction import extract
from geometry import Frame, Pose
from perceptron_emu import Scene, render
from workbench.cell import find_emulator, find_jig, find_robot, find_sensor
from workbench.plan import ViewProblem, plan_views

rng = np.random.default_rng(7)
sensor, jig, robot = find_sensor("nominal"), find_jig("paper"), find_robot("abb_irb6640_180_255")
emulator = find_emulator("nominal")  # light, lens, noise and exposure of its images

# T_a_b maps b-coordinates to a. The SCP by design, and where the sensor really sits (Table 1 of the paper).
design = Pose.from_fixed_xyz_deg((0, 0, 20), (-17, -76, 117))
T_hand_sensor = Pose.from_fixed_xyz_deg((-1.5241, 1.5871, 22.5287), (-16.8786, -75.5423, 116.5369))

# Two places of the jig: its x axis (the pillar) points up, its back away from the robot.
upright = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
places = {"A": Pose(upright, np.array([1700.0, -400.0, 800.0])), "B": Pose(upright, np.array([1600.0, 450.0, 950.0]))}

frames = []
for location, T_base_jig in places.items():
    views = plan_views(ViewProblem(robot, sensor, jig, T_base_jig, design), 7, rng)
    for joints in views.joints_rad:
        T_sensor_jig = (robot.pose(joints) @ T_hand_sensor).inverse() @ T_base_jig
        image = render(Scene(sensor, jig, T_sensor_jig), emulator, rng).image
        spots = extract(image, sensor)
        frames.append(Frame(len(frames), location, points=spots, joints_rad=joints))

result = calibrate(frames, jig, robot, sensor, design)

print(f"verdict: {result.verdict.code}, {result.verdict.text}")
if result.T_hand_sensor is not None:
    for name, pose in (("design", design), ("solved", result.T_hand_sensor), ("true", T_hand_sensor)):
        print(f"{name:>7}: {np.round(pose.fixed_xyz_deg, 4)}° {np.round(pose.t, 3)} mm")
    print(f"      σ: {np.round(result.sigma_rotation_deg, 4)}° {np.round(result.sigma_translation_mm, 3)} mm")
