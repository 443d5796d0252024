"""URDF robots: the chain of revolute joints between two links, as a Denavit-Hartenberg model."""

from __future__ import annotations

import codecs
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

import numpy as np
from defusedxml import DefusedXmlException, ElementTree
from numpy.typing import NDArray

from geometry import ChainJoint, DhRobot, InputError, Pose, Remark, no_remark, read_bytes, robot_from_chain
from workbench.files.strict import suggestion

Array = NDArray[np.float64]

MOVING = ("revolute", "continuous")
LONGEST_M = 100.0  # from joint to joint: beyond it the lengths are millimetres
LARGEST_RAD = 4 * np.pi  # of roll, pitch, yaw: beyond it they are degrees
LEAST_ROUNDING_RAD = 2e-5  # 0.02 mm at a metre: what four digits and fewer leave of π/2
EXPAND = "which must be expanded to a plain URDF first: xacro FILE > arm.urdf"
_ENCODING = re.compile(rb"""\s*<\?xml[^>]{0,200}?encoding\s*=\s*["']([A-Za-z][A-Za-z0-9._\-]{0,39})["']""")
_NO_ENCODINGS = frozenset(("punycode", "idna", "undefined", "unicode_escape", "raw_unicode_escape", "utf-7"))


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
    ``remark`` is told of angles that are written to few digits.
    """
    joints = read_chain(parse_urdf(path), path, base, tip)
    if sentence := _rounded_angles(joints, path):
        remark(sentence)
    return robot_from_chain(joints, f"{path.stem}: {base} to {tip}")


def parse_urdf(path: Path) -> Any:
    """The root element of a URDF file; InputError where it is no XML, holds entities, is a xacro or no robot."""
    text = _decoded(path)
    try:
        root = ElementTree.fromstring(text, forbid_dtd=True)
    except DefusedXmlException as error:
        kind = type(error).__name__.removesuffix("Forbidden")
        raise InputError(f"{path}: declares {kind}, which a URDF does not need and may harm: remove it") from None
    except (ParseError, ValueError) as error:
        if "<xacro:" in text:
            raise InputError(f"{path}: is a xacro, {EXPAND}") from None
        line = f", line {error.position[0]}" if isinstance(error, ParseError) else ""
        raise InputError(f"{path}{line}: is not well-formed XML ({error})") from None
    if "<xacro:" in text and any(str(element.tag).startswith("{") for element in root.iter()):
        raise InputError(f"{path}: is a xacro, {EXPAND}")
    if any("${" in value or "$(" in value for element in root.iter() for value in element.attrib.values()):
        raise InputError(f"{path}: holds xacro expressions (${{…}}), {EXPAND}")
    if root.tag != "robot":
        raise InputError(f"{path}: the outermost element is <{str(root.tag)[:60]}>, a URDF's is <robot>")
    return root


def _decoded(path: Path) -> str:
    """The text by its byte-order mark, else by the encoding that its first line declares, else as UTF-8."""
    raw = read_bytes(path)
    declared = _ENCODING.match(raw)
    name = declared[1].decode("ascii") if declared else "utf-8"
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        name = "utf-16"
    elif raw.startswith(codecs.BOM_UTF8) or name.casefold() == "utf-8":
        name = "utf-8-sig"
    try:
        if name.casefold() in _NO_ENCODINGS:
            raise LookupError
        return raw.decode(name)
    except LookupError:
        raise InputError(f'{path}: declares the encoding "{name}", which is not known') from None
    except UnicodeError as error:
        line = raw[: getattr(error, "start", 0)].count(b"\n") + 1
        raise InputError(f"{path}, line {line}: is not text in its encoding, {name.removesuffix('-sig')}") from None


def _rounded_angles(joints: Sequence[UrdfJoint], path: Path) -> str:
    """Says which angles are meant to be parts of a right angle and are written too short to be."""
    found: list[str] = []
    worst = 0.0
    for joint in joints:
        origin = joint.element.find("origin")
        for word in "" if origin is None else origin.get("rpy", "").split():
            digits = len(word.partition(".")[2]) if re.fullmatch(r"[+-]?\d*\.\d+", word) else 0
            step = np.pi / (12 if digits >= 3 else 4)
            off = abs(float(word) - step * round(float(word) / step)) if digits >= 2 else 0.0
            if LEAST_ROUNDING_RAD < off <= 10.0**-digits:
                found.append(f"{word} of {joint.name}")
                worst = max(worst, off)
    if not found:
        return ""
    shown = ", ".join(found[:8]) + (f" and {len(found) - 8} more" if len(found) > 8 else "")
    return (
        f"{path}: angles are written to few digits ({shown}), up to {np.rad2deg(worst):.2g}° off the part of a "
        f"right angle that is meant, which moves the hand by {worst * 1000:.2g} mm a metre of reach: write them "
        "in full, 1.57 as 1.5707963267948966"
    )


def read_chain(root: Any, path: Path, base: str, tip: str) -> list[UrdfJoint]:
    """The joints from ``base`` to ``tip``, in order; at least one of them moves."""
    links = [_attribute(e, "name", f"{path}: a <link>") for e in root.findall("link")]
    for name, count in Counter(links).items():
        if count > 1:
            raise InputError(f'{path}: link "{name[:60]}" is declared twice')
    for role, name in (("base", base), ("tip", tip)):
        if name not in links:
            raise InputError(f'{path}: there is no link "{name}" for {role}{suggestion(name, links)}')
    above = _joints_by_child(root, path, set(links))
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


def urdf_ends(path: Path) -> tuple[str, str]:
    """The first and the last link of the arm in a URDF file: its only root, and tool0, or the only end that most joints
    move.

    InputError where several could be meant: a robot.toml with urdf, base and tip says which.
    """
    root = parse_urdf(path)
    links = [_attribute(e, "name", f"{path}: a <link>") for e in root.findall("link")]
    above = _joints_by_child(root, path, set(links))
    parents = {child: str(element.find("parent").get("link")) for child, element in above.items()}
    roots = [name for name in links if name not in parents]
    if len(roots) != 1:
        raise InputError(f"{path}: {len(roots)} links hang on no joint, a robot has one: {_say_which(roots)}")
    moves = {child: element.get("type") != "fixed" for child, element in above.items()}
    ends = set(links) - set(parents.values())
    moved = {name: _moving_above(name, parents, moves) for name in ends}
    most = max(moved.values(), default=0)
    best = sorted(name for name, n in moved.items() if n == most)
    tip = "tool0" if "tool0" in best else best[0]
    if most == 0 or (len(best) > 1 and tip != "tool0"):
        raise InputError(f"{path}: {len(best)} links could be the hand: {_say_which(best)}")
    return roots[0], tip


def _moving_above(name: str, parents: dict[str, str], moves: dict[str, bool]) -> int:
    count, seen = 0, {name}
    while name in parents:
        count += moves[name]
        name = parents[name]
        if name in seen:
            return 0  # a loop, which read_chain names
        seen.add(name)
    return count


def _say_which(names: Sequence[str]) -> str:
    shown = ", ".join(name[:60] for name in names[:8]) or "none"
    return f"{shown}; write a robot.toml with urdf, base and tip"


def _joints_by_child(root: Any, path: Path, links: set[str]) -> dict[str, Any]:
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
    if np.abs(xyz).max() > LONGEST_M:
        raise InputError(f"{where} is {np.abs(xyz).max():g} m off the one before: a URDF's lengths are metres")
    if np.abs(rpy).max() > LARGEST_RAD:
        raise InputError(f"{where} has an angle of {np.abs(rpy).max():g} rad: a URDF's angles are radians")
    axis, low, high = None, 0.0, 0.0
    if kind != "fixed":
        axis = _numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0), where)
        if not np.linalg.norm(axis) > 1e-9:
            raise InputError(f"{where} has an axis of length 0")
        axis = axis / np.linalg.norm(axis)
        low, high = _limits(element, kind, where)
    ends = element.find("parent").get("link"), element.find("child").get("link")
    # roll, pitch, yaw are turns about fixed x, y, z
    turned = Pose.from_fixed_xyz_deg(np.rad2deg(rpy), xyz * 1000) if rpy.any() else Pose(np.eye(3), xyz * 1000)
    return UrdfJoint(turned, axis, low, high, name, *ends, element)


def _limits(element: Any, kind: str, where: str) -> tuple[float, float]:
    """Infinite where nobody wrote one."""
    limit = element.find("limit")
    if kind == "continuous" or limit is None:
        return -np.inf, np.inf
    wide = {"lower": -np.inf, "upper": np.inf}
    low, high = (
        end if limit.get(key) is None else float(_numbers(limit, key, (0.0,), where)[0]) for key, end in wide.items()
    )
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
