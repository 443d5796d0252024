"""A starter dataset: every file commented, from presets, ready to be emulated or filled with a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geometry import Arm, InputError, Pose, Role, Sensor, did_you_mean, toml_value
from workbench.cell.presets import DESIGN_SCP, find_robot, is_urdf, preset_path
from workbench.files import read_sensor, read_target, urdf_ends, write_bytes

REACH_OF_PLACES_MM = 2550.0  # the places below suit an arm of this reach; others get them in proportion
PLACES: dict[str, tuple[Role, tuple[float, float, float], float]] = {
    "A": ("calibrate", (1560.0, -780.0, 830.0), -28.0),
    "B": ("calibrate", (1850.0, 110.0, 700.0), 4.0),
    "C": ("calibrate", (1450.0, 830.0, 980.0), 32.0),
    "D": ("verify", (1720.0, -300.0, 980.0), -10.0),
}
_UPRIGHT = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # pillar up, its back away from the robot

CELL = """\
# A cell dataset: sensor, jig, robot and frames of one calibration.
# `perceptron-emu calibrate FOLDER` solves it, `perceptron-emu render FOLDER --out OTHER` makes images of it.
name = {name}
sensor = "sensor.toml"   # camera, laser and (for emulation) light, optics, noise
{target}
robot = "robot.toml"     # the arm's Denavit-Hartenberg table, or urdf = "arm.urdf", base = …, tip = …
frames = "frames.csv"    # one row {an_image}: location, role, joint readings in degrees

[scp_initial]            # where the sensor sits on the hand by design: T_hand_sensor
rotation_deg = {rotation}           # about fixed X, Y, Z: R = Rz Ry Rx
translation_mm = {translation}

# If frames.csv holds a controller's poses in place of joint readings, say whose, without the # signs:
# [poses]
# convention = "fanuc"      # or "kuka", "yaskawa", "mitsubishi", "abb", "ros", "ur"
# tool = [0, 0, 0, 0, 0, 0] # the TOOL that was active, base = [...] the UFRAME or BASE; leave out what was zero

# Where the {thing} stands, T_base_jig in mm. Needed to emulate; for a recording leave these out, calibrate finds them.
# role: "calibrate" places are solved with, "verify" places only check the solution.
"""
FRAMES = """\
# frame: a number; {what}; location: one name for each place of the target; role: calibrate or verify
# joint readings in degrees; or x_mm, y_mm, z_mm, qw, qx, qy, qz of T_base_hand in their place; or a controller's own
# columns, such as X, Y, Z, W, P, R, with [poses] in cell.toml. Excel's CSV is read as it is, with decimal commas, too
"""


TARGETS = {
    "sphere": "diameter_mm = 40.0      # leave it out where it is not known: it is then estimated\n",
    "balls": "".join(
        f"[[ball]]\nname = {toml_value(name)}\ndiameter_mm = 30.0\ncentre_mm = [{x}, {y}, 0.0] # their own frame\n"
        for name, x, y in (("first", -40.0, 0.0), ("second", 40.0, 0.0), ("third", 0.0, 50.0))
    ),
    "plane": "width_mm = 180.0\nheight_mm = 140.0\n",
    "edge": "# a plate's straight border, where the profile ends or jumps\n",
    "wedge": "angle_deg = 90.0        # leave it out where it is not known: it is then estimated\n",
}
_FACING = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # a surface's z towards the robot, x level


def write_starter(folder: Path, robot: str, sensor: str, jig: str, target: str | None = None) -> str:
    """Write cell.toml, sensor.toml, jig.toml or target.toml, robot.toml and frames.csv into a new or empty folder.

    target: a kind of TARGETS or a target.toml, in place of the jig. Returns the folder beside them that is to be
    filled: images or profiles.
    """
    files = {"robot": preset_path("robots", robot), "sensor": preset_path("sensors", sensor)}
    if target is None:
        files["jig"] = preset_path("jigs", jig)
    arm, model = find_robot(robot), read_sensor(files["sensor"])
    measured = "images" if model.profile is None and target is None else "profiles"
    columns = ",".join(["frame", measured[:-1], "location", "role", *(f"j{i + 1}_deg" for i in range(arm.n_joints))])
    content = {f"{name}.toml": path.read_bytes() for name, path in files.items()}
    if is_urdf(files["robot"]):
        content |= _urdf_content(files["robot"])
    if target is not None:
        content["target.toml"] = _target_bytes(target)
    what = "image: PNG or TIFF" if measured == "images" else "profile: a file, or one for many rows"
    head = FRAMES.format(what=what)
    content |= {"frames.csv": f"{head}{columns}\n".encode(), "cell.toml": _cell_text(arm, model, target).encode()}
    if not _is_free(folder, content):
        raise InputError(f"{folder}: is not empty; a starter dataset needs a new or an empty folder")
    try:
        (folder / measured).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: can not be written ({error.strerror})") from None
    for name, data in content.items():
        write_bytes(folder / name, data)
    return measured


def _urdf_content(path: Path) -> dict[str, bytes]:
    base, tip = (toml_value(name) for name in urdf_ends(path))
    table = f"urdf = {toml_value(path.name)}\nbase = {base}\ntip = {tip}\n"
    return {"robot.toml": table.encode(), path.name: path.read_bytes()}


def _target_bytes(target: str) -> bytes:
    if target in TARGETS:
        return f"kind = {toml_value(target)}\n{TARGETS[target]}".encode()
    path = Path(target)
    if not path.is_file():
        near = did_you_mean(target, TARGETS) or f"; {', '.join(TARGETS)} or a file are right"
        raise InputError(f'--target "{target}" is no file and no kind of target{near}')
    read_target(path)
    return path.read_bytes()


def _is_free(folder: Path, content: dict[str, bytes]) -> bool:
    """Whether nothing stands in ``folder`` but what a call like this one left when it was killed half way."""
    if not folder.exists():
        return True
    if not folder.is_dir():
        return False
    for path in folder.iterdir():
        empty = path.is_dir() and path.name in ("images", "profiles") and not any(path.iterdir())
        ours = path.is_file() and path.name in content and path.name != "cell.toml"
        part = path.name.endswith(".part") and path.name.startswith(tuple(f".{name}." for name in content))
        if not (empty or part or (ours and content[path.name] == path.read_bytes())):
            return False
    return True


def place_of_jig(origin_mm: tuple[float, float, float], turn_deg: float, scale: float = 1.0) -> Pose:
    """T_base_jig of an upright jig whose front faces the robot, turned about the vertical."""
    turn = Pose.from_fixed_xyz_deg((0.0, 0.0, turn_deg), (0.0, 0.0, 0.0))
    return Pose(turn.R @ _UPRIGHT, scale * np.array(origin_mm))


def reach_mm(robot: Arm) -> float:
    """A rough reach of the arm: its links beyond the first joint's height, end to end."""
    table = robot.dh_part()
    return float(np.sum(np.abs(table.a[1:])) + np.sum(np.abs(table.d[1:])) + abs(table.a[0]))


def _cell_text(arm: Arm, sensor: Sensor, target: str | None) -> str:
    rotation, translation = (np.round(v, 9) + 0.0 for v in (DESIGN_SCP.fixed_xyz_deg, DESIGN_SCP.t))
    numbers = {"rotation": toml_value(rotation.tolist()), "translation": toml_value(translation.tolist())}
    named, thing = 'jig = "jig.toml"         # the string jig', "jig"
    if target is not None:
        named, thing = 'target = "target.toml"   # what is measured', "target"
    row = "an image" if target is None and sensor.profile is None else "a profile"
    text = CELL.format(name=toml_value(_name(arm, sensor)), target=named, an_image=row, thing=thing, **numbers)
    return text + _locations(arm, jig=target is None)


def _locations(arm: Arm, *, jig: bool) -> str:
    scale = min(1.0, reach_mm(arm) / REACH_OF_PLACES_MM)
    lines = []
    for name, (role, origin, turn) in PLACES.items():
        place = place_of_jig(origin, turn, scale)
        if not jig:
            place = Pose(place.R @ _UPRIGHT.T @ _FACING, place.t)
        rows = np.round(place.matrix, 9) + 0.0
        lines += [f"[locations.{name}]", f"role = {toml_value(role)}", f"T_base_jig = {toml_value(rows.tolist())}"]
    return "\n".join(lines) + "\n"


def _name(arm: Arm, sensor: Sensor) -> str:
    return f"{sensor.name or 'sensor'} on {arm.name or 'arm'}"
