"""A calibrated robot written back into its URDF: joint origins changed so that the chain is the corrected one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from defusedxml import ElementTree

from geometry import InputError, Pose, RobotModel
from workbench.files.atomic import write_text
from workbench.files.urdf import UrdfJoint, joint_frames, parse_urdf, read_chain, read_urdf


def write_urdf(source: Path, base: str, tip: str, corrected: RobotModel, target: Path) -> None:
    """Write ``source`` to ``target`` with the chain from ``base`` to ``tip`` as ``corrected`` has it.

    corrected: the model that ``read_urdf(source, base, tip)`` gives, with its parameters corrected. Only origins on
    the chain change; where the tip hangs directly on the last joint, a fixed joint is put between, because errors of
    the last link can not be told by that joint's origin.
    """
    nominal, root = read_urdf(source, base, tip), parse_urdf(source)
    _check_same_arm(nominal, corrected)
    joints = read_chain(root, source, base, tip)
    moving = [i for i, joint in enumerate(joints) if joint.axis is not None]
    rest = np.zeros(nominal.n_joints)
    old, new = nominal.link_poses(rest), corrected.link_poses(rest)
    frames, here = joint_frames(joints), Pose.identity()
    for i, joint in enumerate(joints):
        if joint.axis is None:
            here = here @ joint.origin
            continue
        k = moving.index(i)
        # the joint's frame sits on its axis as before: F⁻¹ U is kept while the axis frame F moves
        goal = new[k] @ (old[k].inverse() @ frames[i])
        _set_origin(joint.element, here.inverse() @ goal)
        here = goal
    _place_tip(root, joints, corrected.hand_pose(rest), here)
    write_text(target, ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n")


def _place_tip(root: Any, joints: list[UrdfJoint], tip: Pose, here: Pose) -> None:
    """Bring the tip to its corrected pose by the last fixed joint, made where there is none."""
    last = joints[-1]
    if last.axis is None:
        _set_origin(last.element, last.origin @ (here.inverse() @ tip))
        return
    name = f"{last.name}_corrected"
    between = root.makeelement("link", {"name": f"{name}_link"})
    fixed = root.makeelement("joint", {"name": name, "type": "fixed"})
    fixed.append(fixed.makeelement("parent", {"link": f"{name}_link"}))
    fixed.append(fixed.makeelement("child", {"link": last.child}))
    last.element.find("child").set("link", f"{name}_link")
    _set_origin(fixed, here.inverse() @ tip)
    root.extend([between, fixed])


def _set_origin(element: Any, origin: Pose) -> None:
    place = element.find("origin")
    if place is None:
        place = element.makeelement("origin", {})
        element.insert(0, place)
    place.set("xyz", " ".join(repr(float(v)) for v in origin.t / 1000))
    place.set("rpy", " ".join(repr(float(v)) for v in np.deg2rad(origin.fixed_xyz_deg)))


def _check_same_arm(nominal: RobotModel, corrected: RobotModel) -> None:
    if corrected.n_joints != nominal.n_joints:
        raise InputError(f"the corrected robot has {corrected.n_joints} joints, the URDF's chain {nominal.n_joints}")
    if corrected.coupling is not None or np.any(corrected.sign != 1) or corrected.convention != nominal.convention:
        raise InputError("the corrected robot is not the URDF's: its signs, coupling or convention differ")
