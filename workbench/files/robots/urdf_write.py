"""A calibrated robot written back into its URDF: joint origins changed so that the chain is the corrected one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from defusedxml import ElementTree

from geometry import DhRobot, InputError, Pose, corrected_origins
from workbench.files.atomic import write_text
from workbench.files.robots.urdf import UrdfJoint, parse_urdf, read_chain, read_urdf

_DECIMALS = 13  # of metres and radians: more than the chain needs, fewer than hang on the processor


def write_urdf(source: Path, base: str, tip: str, corrected: DhRobot, target: Path) -> None:
    """Write ``source`` to ``target`` with the chain from ``base`` to ``tip`` as ``corrected`` has it.

    corrected: the model that ``read_urdf(source, base, tip)`` gives, with its parameters corrected. Only origins on
    the chain change; where the tip hangs directly on the last joint, a fixed joint is put between, because errors of
    the last link can not be told by that joint's origin.
    """
    nominal, root = read_urdf(source, base, tip), parse_urdf(source)
    _check_same_arm(nominal, corrected)
    joints = read_chain(root, source, base, tip)
    origins, to_tip = corrected_origins(joints, corrected)
    for joint, origin in zip(joints, origins, strict=True):
        if joint.axis is not None:
            _set_origin(joint.element, origin)
    _place_tip(root, joints, to_tip)
    write_text(target, ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n")


def _place_tip(root: Any, joints: list[UrdfJoint], to_tip: Pose) -> None:
    """Put ``to_tip`` between the last joint and the tip: in the last fixed joint, made where there is none."""
    last = joints[-1]
    if last.axis is None:
        _set_origin(last.element, last.origin @ to_tip)
        return
    name = f"{last.name}_corrected"
    between = root.makeelement("link", {"name": f"{name}_link"})
    fixed = root.makeelement("joint", {"name": name, "type": "fixed"})
    fixed.append(fixed.makeelement("parent", {"link": f"{name}_link"}))
    fixed.append(fixed.makeelement("child", {"link": last.child}))
    last.element.find("child").set("link", f"{name}_link")
    _set_origin(fixed, to_tip)
    root.extend([between, fixed])


def _set_origin(element: Any, origin: Pose) -> None:
    place = element.find("origin")
    if place is None:
        place = element.makeelement("origin", {})
        element.insert(0, place)
    place.set("xyz", " ".join(repr(round(float(v), _DECIMALS)) for v in origin.t / 1000))
    place.set("rpy", " ".join(repr(round(float(v), _DECIMALS)) for v in np.deg2rad(origin.fixed_xyz_deg)))


def _check_same_arm(nominal: DhRobot, corrected: DhRobot) -> None:
    if corrected.n_joints != nominal.n_joints:
        raise InputError(f"the corrected robot has {corrected.n_joints} joints, the URDF's chain {nominal.n_joints}")
    if corrected.coupling is not None or np.any(corrected.sign != 1) or corrected.convention != nominal.convention:
        raise InputError("the corrected robot is not the URDF's: its signs, coupling or convention differ")
