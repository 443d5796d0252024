"""A robot error of your own, from outside the packages: the gear of joint 2 is eccentric, a sine of its reading.

The error is a decorator of any robot: its parameters get a prior, and the solver estimates them like all others.
"""

from dataclasses import replace

import numpy as np

from calib import CalibConfig
from calib.synthetic import Noise, calibrated, industrial_arm, made_cell, observe, random_cell
from geometry import JointDeviation, Parameter

JOINT, SIGMA_RAD = 1, 1e-3  # counted from 0; what such a gear may do: 0.06°


class EccentricGear(JointDeviation):
    """The joint turns further than it reads by a · sin(q) + b · cos(q), with a and b unknown."""

    @property
    def own_parameters(self):
        """Amplitudes of sine and cosine."""
        return tuple(Parameter(f"{name}{JOINT + 1}", "rad", SIGMA_RAD, "gear") for name in ("gear_sin", "gear_cos"))

    def deviation(self, joints_rad, values):
        """δ(q) (..., n) [rad]."""
        out = np.zeros_like(joints_rad)
        q = joints_rad[..., JOINT]
        out[..., JOINT] = values[0] * np.sin(q) + values[1] * np.cos(q)
        return out


def main() -> dict[str, float]:
    """Calibrate a cell whose arm has the error, without it in the model and with it: squared errors in σ."""
    rng = np.random.default_rng(3)
    cell = random_cell(rng)
    made = made_cell(cell, rng, Noise())
    gear = EccentricGear(industrial_arm())
    eccentric = np.array([*np.zeros(len(gear.robot.parameters)), 1.5e-3, -1e-3])
    made = replace(made, robot=EccentricGear(made.robot).corrected(eccentric))
    observed = observe(cell, made, rng, Noise())
    out = {}
    for name, robot in (("table alone", cell.robot), ("with the gear", gear)):
        result = calibrated(observed, cell.jig, robot, CalibConfig(model="full"))
        error = (result.estimate.T_hand_sensor.inverse() @ made.T_hand_sensor).log()
        out[name] = float(error @ np.linalg.solve(result.estimate.covariance, error))
        print(f"{name}: {result.verdict.code}, χ² {result.chi2_per_dof:.2f}, squared error in σ {out[name]:.1f}")
    found = dict(zip((p.name for p in gear.parameters), result.robot_delta, strict=True))
    sine, cosine = found["gear_sin2"] * 1e6, found["gear_cos2"] * 1e6
    print(f"gear: sine {sine:.0f} µrad (true 1500), cosine {cosine:.0f} µrad (true -1000)")
    return out


if __name__ == "__main__":
    main()
