"""URDF robots: the chain of revolute joints between two links, as a Denavit-Hartenberg model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

import numpy as np
from defusedxml import DefusedXmlException, ElementTree
from numpy.typing import NDArray

from geometry import ChainJoint, DhRobot, InputError, Pose, Remark, no_remark, read_text, robot_from_chain
from workbench.files.strict import suggestion

Array = NDArray[np.float64]

MOVING = ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class UrdfJoint(ChainJoint):
    """A joint of the chain with its name, its links, and the XML element, for a writer."""

    name: str
    parent: str
    child: str
    element: Any


def read_urdf(path: Path, base: str, tip: str, remark: Remark = no_remark) -> DhRobot:
    """The revolute chain from link ``base`` to link ``tip`` of a URDF file, in mm; fixed joints are taken in.

    InputError names what can not be: links that are missing, loops, joints that slide, entities, broken numbers.
    """
    joints = read_chain(parse_urdf(path), path, base, tip)
    return robot_from_chain(joints, f"{path.stem}: {base} to {tip}")


def parse_urdf(path: Path) -> Any:
    """The root element of a URDF file; InputError where it is no XML, holds entities, or is no robot."""
    text = read_text(path)
    try:
        root = ElementTree.fromstring(text, forbid_dtd=True)
    except DefusedXmlException as error:
        kind = type(error).__name__.removesuffix("Forbidden")
        raise InputError(f"{path}: declares {kind}, which a URDF does not need and may harm: remove it") from None
    except (ParseError, ValueError) as error:
        line = f", line {error.position[0]}" if isinstance(error, ParseError) else ""
        raise InputError(f"{path}{line}: is not well-formed XML ({error})") from None
    if root.tag != "robot":
        raise InputError(f"{path}: the outermost element is <{root.tag}>, a URDF's is <robot>")
    if "${" in text:
        raise InputError(f"{path}: holds xacro expressions (${{…}}): expand it to a plain URDF first (xacro FILE)")
    return root


def read_chain(root: Any, path: Path, base: str, tip: str) -> list[UrdfJoint]:
    """The joints from ``base`` to ``tip``, in order; at least one of them moves."""
    links = [_attribute(e, "name", f"{path}: a <link>") for e in root.findall("link")]
    for name in links:
        if links.count(name) > 1:
            raise InputError(f'{path}: link "{name}" is declared twice')
    for role, name in (("base", base), ("tip", tip)):
        if name not in links:
            raise InputError(f'{path}: there is no link "{name}" for {role}{suggestion(name, links)}')
    above = _joints_by_child(root, path, links)
    chain: list[UrdfJoint] = []
    here, seen = tip, {tip}
    while here != base:
        if here not in above:
            raise InputError(f'{path}: no chain leads from link "{base}" to "{tip}": "{here}" has no parent joint')
        chain.append(_joint(above[here], path))
        here = chain[-1].parent
        if here in seen:
            raise InputError(f'{path}: the joints above link "{here}" form a loop; a robot must be a tree')
        seen.add(here)
    if not any(joint.axis is not None for joint in chain):
        raise InputError(f'{path}: no joint moves between link "{base}" and "{tip}"; base and tip must span the arm')
    return chain[::-1]


def _joints_by_child(root: Any, path: Path, links: list[str]) -> dict[str, Any]:
    above: dict[str, Any] = {}
    for element in root.findall("joint"):
        name = _attribute(element, "name", f"{path}: a <joint>")
        for end in ("parent", "child"):
            if (part := element.find(end)) is None:
                raise InputError(f'{path}: joint "{name}" has no <{end} link="…"/>')
            link = _attribute(part, "link", f'{path}: the {end} of joint "{name}"')
            if link not in links:
                raise InputError(f'{path}: joint "{name}" names the link "{link}", which is missing')
        child = element.find("child").get("link")
        if child in above:
            both = f'"{above[child].get("name")}" and "{name}"'
            raise InputError(f'{path}: link "{child}" hangs on two joints, {both}: loops can not be read')
        above[child] = element
    return above


def _joint(element: Any, path: Path) -> UrdfJoint:
    name, kind = element.get("name"), element.get("type")
    where = f'{path}: joint "{name}"'
    if kind not in (*MOVING, "fixed"):
        raise InputError(f'{where} is of type "{kind}": only revolute, continuous and fixed joints can be in the chain')
    if kind != "fixed" and element.find("mimic") is not None:
        raise InputError(f"{where} mimics another joint: a chain of independent joints is needed")
    origin = element.find("origin")
    xyz = _numbers(origin, "xyz", (0.0, 0.0, 0.0), where)
    rpy = _numbers(origin, "rpy", (0.0, 0.0, 0.0), where)
    axis, low, high = None, 0.0, 0.0
    if kind != "fixed":
        axis = _numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0), where)
        if not np.linalg.norm(axis) > 1e-9:
            raise InputError(f"{where} has an axis of length 0")
        axis = axis / np.linalg.norm(axis)
        low, high = _limits(element, kind, where)
    ends = element.find("parent").get("link"), element.find("child").get("link")
    # roll, pitch, yaw are turns about fixed x, y, z
    return UrdfJoint(Pose.from_fixed_xyz_deg(np.rad2deg(rpy), xyz * 1000), axis, low, high, name, *ends, element)


def _limits(element: Any, kind: str, where: str) -> tuple[float, float]:
    if kind == "continuous":
        return -2 * np.pi, 2 * np.pi
    limit = element.find("limit")
    if limit is None:
        raise InputError(f"{where} is revolute but has no <limit lower upper>")
    low, high = (float(_numbers(limit, key, (0.0,), where)[0]) for key in ("lower", "upper"))
    if low >= high:
        raise InputError(f"{where} has limits {low:g} … {high:g} rad, which leave no angle")
    return low, high


def _numbers(element: Any, key: str, default: tuple[float, ...], where: str) -> Array:
    text = None if element is None else element.get(key)
    if text is None:
        return np.array(default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        raise InputError(f'{where}: {key}="{text[:60]}" must be {len(default)} numbers') from None
    if len(values) != len(default) or not np.all(np.isfinite(values)):
        raise InputError(f'{where}: {key}="{text[:60]}" must be {len(default)} finite numbers')
    return values


def _attribute(element: Any, key: str, where: str) -> str:
    value = element.get(key)
    if not value:
        raise InputError(f"{where} has no {key}")
    return str(value)
