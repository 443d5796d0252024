"""Files and presets by name: what a user may give where a sensor, jig or robot is asked for."""

from __future__ import annotations

from pathlib import Path

import assets
from calib.synthetic import DESIGN
from geometry import Arm, Sensor, Target
from jig_cad import Jig
from perceptron_emu import EmulatorConfig
from workbench.files import read_emulator, read_jig_file, read_robot, read_sensor, read_target, read_urdf, urdf_ends

DESIGN_SCP = DESIGN  # T_hand_sensor by design of the paper's Table 1: emulated cells and starters mount their sensor so


def preset_path(kind: str, name: str) -> Path:
    """The file ``name``, or the preset of that name where there is no such file and it does not look like one."""
    path = Path(name)
    if path.exists() or path.suffix or "/" in name:
        return path
    return assets.path(kind, name)


def find_jig(name: str) -> Jig:
    """A jig by file or preset.

    Parameters
    ----------
    name : str
        The path of a jig.toml, or the name of a preset.

    Returns
    -------
    Jig

    Raises
    ------
    InputError
        Where there is neither, with the nearest name, or where the file is wrong, by its key.
    """
    return read_jig_file(preset_path("jigs", name))


def find_target(name: str) -> Target:
    """A target of any kind by file, or a jig by preset.

    Parameters
    ----------
    name : str
        The path of a target.toml or jig.toml, or the name of a preset.

    Returns
    -------
    Target

    Raises
    ------
    InputError
        Where there is neither, with the nearest name, or where the file is wrong, by its key.
    """
    return read_target(preset_path("jigs", name))


def find_sensor(name: str) -> Sensor:
    """A sensor by file or preset.

    Parameters
    ----------
    name : str
        The path of a sensor.toml, or the name of a preset.

    Returns
    -------
    Sensor

    Raises
    ------
    InputError
        Where there is neither, with the nearest name, or where the file is wrong, by its key.
    """
    return read_sensor(preset_path("sensors", name))


def find_emulator(name: str) -> EmulatorConfig:
    """How a sensor by file or preset is emulated.

    Parameters
    ----------
    name : str
        The path of a sensor.toml, or the name of a preset.

    Returns
    -------
    EmulatorConfig

    Raises
    ------
    InputError
        Where there is neither, with the nearest name, or where the file is wrong, by its key.
    """
    return read_emulator(preset_path("sensors", name))


def find_robot(name: str) -> Arm:
    """A robot by file or preset.

    Parameters
    ----------
    name : str
        The path of a robot.toml or URDF, or the name of a preset; of a URDF from its root to tool0, or to its
        only hand.

    Returns
    -------
    Arm

    Raises
    ------
    InputError
        Where there is neither, with the nearest name, or where the file is wrong, by its key.
    """
    path = preset_path("robots", name)
    return read_urdf(path, *urdf_ends(path)) if is_urdf(path) else read_robot(path)


def is_urdf(path: Path) -> bool:
    """Whether a robot's file is a URDF by its name."""
    return path.suffix.lower() == ".urdf"
