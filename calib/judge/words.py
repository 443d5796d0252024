"""What is said of a number that is contradicted: which it is, by how much, in which file to look."""

from __future__ import annotations

from calib.result import Culprit, Pull
from geometry.robot import READING_SCALE

_KEYS = {"theta": "theta_offset_deg", "d": "d_mm", "a": "a_mm", "alpha": "alpha_deg", "beta": "beta_deg"}
_SHOWN = 4  # of what can not be told from it
_PLANE = {
    "plane_tilt_y_deg": "the laser plane's tilt about y ([camera.pose] of sensor.toml)",
    "plane_tilt_z_deg": "the laser plane's tilt about z ([camera.pose] of sensor.toml)",
    "plane_shift_mm": "the laser plane's distance from the camera ([camera.pose] of sensor.toml)",
    "k1": "the lens's distortion ([camera] distortion of sensor.toml)",
}


def accusation(culprit: Culprit) -> str:
    """The sentence that names the number, its row, size and unit, and its file."""
    if culprit.unit == "times" and culprit.parameter.endswith("joint_sigma_deg"):
        return (
            f"the joint readings scatter about {culprit.size:.2g} times more than joint_sigma_deg of [uncertainty] of "
            f"robot.toml says (evidence {culprit.pull_sigma:.1f} σ): state it as it is"
        )
    if culprit.unit == "times":
        return (
            f"the errors of the robot's table are about {culprit.size:.2g} times larger than [uncertainty] of "
            f"robot.toml says (evidence {culprit.pull_sigma:.1f} σ): state them as they are"
        )
    changed = f"{culprit.size:+.3g}{_unit(culprit.unit)}"
    if culprit.parameter.startswith("anchor"):
        changed = f"{abs(culprit.size):.2g} mm"
    text = f"the data contradict {place_of(culprit)}: changed by {changed} it would fit ({_pulled(culprit)})"
    if culprit.same_as:
        more = culprit.same_as[:_SHOWN]
        text += f"; the data can not tell this from {', '.join(more)}"
    return text


def place_of(pull: Pull) -> str:
    """Where a number stands: "a of joint 2 (a_mm of robot.toml)"."""
    if pull.block == "robot" and pull.parameter.startswith("readings"):
        return f"the {pull.parameter}, which it turns together: the zero of its encoder, or its column in frames.csv"
    if pull.block == "robot" and pull.parameter.startswith(READING_SCALE):
        return f"the scale of joint {pull.row}'s readings (its gear, or the unit of its column in frames.csv)"
    if pull.block == "robot":
        name = pull.parameter.rstrip("0123456789")
        key = f"{_KEYS[name]} of robot.toml" if name in _KEYS else "robot.toml"
        readings = f", or the readings of joint {pull.row}" if name == "theta" else ""
        return f"{name} of joint {pull.row} ({key}{readings})"
    if pull.block == "jig":
        return f"{pull.parameter} of jig.toml"
    return _PLANE.get(pull.parameter, f"{pull.parameter} of sensor.toml")


def _unit(unit: str) -> str:
    return {"deg": "°", "": ""}.get(unit, f" {unit}")


def _pulled(pull: Pull) -> str:
    return f"a pull of {abs(pull.pull_sigma):.1f} σ, where sound data give 4 at most"
