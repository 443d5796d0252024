"""How far sensor, hand and arm keep from the target's own solids, from the floor and from boxes to keep out of.

The arm stands as capsules about the lines between its links' origins, the hand as one about the line from the flange to
the sensor's housing, the housing as a box. Distances are exact.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import (
    Arm,
    InputError,
    Pose,
    Sensor,
    Surface,
    Target,
    Workspace,
    box_corners,
    box_to_boxes_mm,
    segments_to_boxes_mm,
)
from geometry.sensor import housing_box
from jig_cad import Balls, Edge, Jig, Plane, Sphere, Wedge
from jig_cad.bodies import target_meshes
from jig_cad.solids import PillarDesign, block_edge_mm

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LINK_SHARE = 0.055  # half a link's thickness over the arm's reach: 63 mm of a UR5e, 85 of a 1.55 m arm
THICKEST_MM = 100.0  # half a link's thickness, of heavy arms that are thick at the shoulder and not at the wrist
HAND_MM = 60.0  # half the thickness of what joins hand and sensor, with its safety distance; assumed
SAFE_MM = 20.0  # of everything from the floor, the boxes and the target, beside thickness
PLATE_MM = 20.0  # thickness of a plate whose file states none
PLATE_SIDE_MM = 200.0  # and its side
SUNK_MM = 5.0  # what a target may stand in the floor by numbers: nobody measures its place better before it is solved
MOVE_STEP_MM = 20.0  # by which no point of the arm moves between two looks at a move


@dataclass(frozen=True, eq=False)
class Standing:
    """An arm with its sensor at readings (N): what of it may touch something.

    joints_mm: (N, J, 3) the links' origins from the shoulder on. link_mm: half the links' thickness. hand: ends
    (N, 2, 3) of the line from the flange to the middle of the housing's back. T_base_sensor: (N). housing: (2, 3).
    """

    joints_mm: Array
    link_mm: float
    hand_mm: Array
    T_base_sensor: Pose
    housing_mm: Array

    def __len__(self) -> int:
        """How many readings."""
        return len(self.joints_mm)


def standing(
    robot: Arm, joints_rad: Array, T_hand_sensor: Pose, sensor: Sensor, link_radius_mm: float | None = None
) -> Standing:
    """The arm at the readings (N, n); without a radius its links are as thick as its reach makes likely."""
    return _with_box(robot, joints_rad, T_hand_sensor, housing_box(sensor), link_radius_mm)


def _with_box(robot: Arm, joints_rad: Array, T_hand_box: Pose, box: Array, link_radius_mm: float | None) -> Standing:
    links, hand = robot.link_poses(joints_rad), robot.pose(joints_rad)
    first = 1 if robot.dh_part().convention == "standard" else 2  # the frame at the shoulder
    T_base_box = hand @ T_hand_box
    return Standing(
        links.t[:, first:],
        link_radius(robot) if link_radius_mm is None else link_radius_mm,
        np.stack([hand.t, T_base_box @ box.mean(axis=0)], axis=1),
        T_base_box,
        box,
    )


def link_radius(robot: Arm) -> float:
    """Half the thickness [mm] of the arm's links, by its reach: no maker's hull is known here."""
    table = robot.dh_part()
    reach = float(np.sum(np.hypot(table.a, table.d)[1:]))
    return min(THICKEST_MM, LINK_SHARE * reach)


@dataclass(frozen=True, eq=False)
class Clearance:
    """What is left at configurations (N) [mm], negative where it is missing: between arm, sensor and target, and in the
    workspace; where: at the floor (-1) or at a box (k).
    """

    at_target: Array
    around: Array
    where: NDArray[np.intp]

    @property
    def least(self) -> Array:
        """The smaller of both (N)."""
        return np.minimum(self.at_target, self.around)


def carrying(
    robot: Arm, joints_rad: Array, T_hand_target: Pose, target: Target, link_radius_mm: float | None = None
) -> Standing:
    """The arm with the target in its hand, the target's box in place of a housing."""
    boxes = target_boxes(target)
    box = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    return _with_box(robot, joints_rad, T_hand_target, box, link_radius_mm)


def room_before_fixed(arm: Standing, T_base_sensor: Pose, sensor: Sensor, workspace: Workspace) -> Clearance:
    """The room of an arm that carries the target before a sensor that stands: links, hand and target keep off it."""
    box = housing_box(sensor)[None]
    T_sensor_base = T_base_sensor.inverse()
    joints, line = T_sensor_base @ arm.joints_mm, T_sensor_base @ arm.hand_mm
    off = [
        np.min(segments_to_boxes_mm(joints[:, :-1], joints[:, 1:], box), axis=(1, 2)) - arm.link_mm,
        segments_to_boxes_mm(line[:, 0], line[:, 1], box)[..., 0] - HAND_MM,
        box_to_boxes_mm(T_sensor_base @ arm.T_base_sensor, arm.housing_mm, box)[..., 0],
    ]
    around, where = room_in_workspace_mm(arm, workspace)
    return Clearance(np.min(off, axis=0) - SAFE_MM, around, where)


def sensor_clearance_mm(sensor: Sensor, jig: Jig, T_sensor_jig: Pose) -> Array:
    """Least distance (N) [mm] of the line from emitter to camera from the jig's solids at the poses (N)."""
    ends = sensor.viewpoints_mm[[0, -1]]
    start, end = ((T_sensor_jig.inverse() @ np.broadcast_to(p, (len(T_sensor_jig), 3))) for p in ends)
    return np.asarray(np.min(segments_to_boxes_mm(start, end, target_boxes(jig)), axis=-1))


def room_at_target_mm(arm: Standing, target: Target, T_base_target: Pose) -> Array:
    """What room (N) [mm] arm, hand and sensor leave beside the target's solids; negative by how much is missing."""
    boxes = target_boxes(target)
    back = T_base_target.inverse()
    hand = np.min(segments_to_boxes_mm(back @ arm.hand_mm[:, 0], back @ arm.hand_mm[:, 1], boxes), axis=-1)
    elbow_on = back @ arm.joints_mm[:, 1:]
    links = np.min(segments_to_boxes_mm(elbow_on[:, :-1], elbow_on[:, 1:], boxes), axis=(1, 2))
    housing = np.min(box_to_boxes_mm(back @ arm.T_base_sensor, arm.housing_mm, boxes), axis=-1)
    return np.asarray(np.min([hand - HAND_MM, links - arm.link_mm, housing], axis=0) - SAFE_MM)


def room_in_workspace_mm(arm: Standing, workspace: Workspace) -> tuple[Array, NDArray[np.intp]]:
    """What room (N) [mm] the arm leaves above the floor and beside the boxes, and at which: -1 the floor, k a box."""
    room, where = np.full(len(arm), np.inf), np.full(len(arm), -1, dtype=np.intp)
    if workspace.floor_z_mm is not None:
        corners = arm.T_base_sensor @ box_corners(arm.housing_mm)[None]
        # the shoulder stands where it stands: what it is mounted on may be lower or higher than a link is thick
        lowest = [
            np.min(arm.joints_mm[:, 1:, 2], axis=1) - arm.link_mm,
            np.min(arm.hand_mm[..., 2], axis=1) - HAND_MM,
            np.min(corners[..., 2], axis=1),
        ]
        room = np.min(lowest, axis=0) - workspace.floor_z_mm
    if len(workspace.boxes_mm):
        boxes = workspace.boxes_mm
        links = np.min(segments_to_boxes_mm(arm.joints_mm[:, :-1], arm.joints_mm[:, 1:], boxes), axis=1) - arm.link_mm
        hand = segments_to_boxes_mm(arm.hand_mm[:, 0], arm.hand_mm[:, 1], boxes) - HAND_MM
        housing = box_to_boxes_mm(arm.T_base_sensor, arm.housing_mm, boxes)
        every = np.column_stack([room, np.min([links, hand, housing], axis=0)])
        where = np.argmin(every, axis=1).astype(np.intp) - 1
        room = np.min(every, axis=1)
    return room - SAFE_MM, where


def target_in_workspace(target: Target, T_base_target: Pose, workspace: Workspace) -> str:
    """How the target stands in what must not be touched, as the end of a sentence, or ""."""
    boxes = target_boxes(target)
    lowest = min(float(np.min((T_base_target @ box_corners(b))[:, 2])) for b in boxes)
    floor = workspace.floor_z_mm
    if floor is not None and lowest < floor - SUNK_MM:
        return (
            f"{floor - lowest:.0f} mm into the floor at z = {floor:g} mm of the base: give [workspace] floor_z_mm "
            "the floor's true height, or false where there is none"
        )
    for name, keep_out in zip(workspace.names, workspace.boxes_mm, strict=True):
        here = Pose(T_base_target.R[None], T_base_target.t[None])
        if any(box_to_boxes_mm(here, b, _shrunk(keep_out)[None])[0, 0] <= 0 for b in boxes):
            return f"into {name}: a box that it stands on ends at its foot"
    return ""


def _shrunk(box: Array) -> Array:
    """The box without its outermost SUNK_MM, or its middle."""
    middle = box.mean(axis=0)
    return np.stack([np.minimum(box[0] + SUNK_MM, middle), np.maximum(box[1] - SUNK_MM, middle)])


def target_boxes(target: Target) -> Array:
    """Least and largest corners (B, 2, 3) of boxes around the target's solids, in its own axes."""
    if isinstance(target, Jig):
        return _jig_boxes(target)
    if isinstance(target, Balls):
        return _around(target.centres_mm, target.diameters_mm / 2)
    if isinstance(target, Sphere):
        return _around(np.zeros((1, 3)), np.array([(target.diameter_mm or 0.0) / 2]))
    if isinstance(target, Plane):
        half = np.array([(target.width_mm or PLATE_SIDE_MM) / 2, (target.height_mm or PLATE_SIDE_MM) / 2])
        return np.array([[[*-half, -PLATE_MM], [*half, 0.0]]])
    if isinstance(target, Surface) and not isinstance(target, Edge | Wedge):
        with suppress(InputError):  # one whose body nobody gave keeps the box of an edge
            return np.array([mesh.bounds for mesh in target_meshes(target).values()])
    edge = PLATE_SIDE_MM / 4 if isinstance(target, Surface) else 0.0
    return np.array([[[-edge, -edge, -edge], [edge, edge, 0.0]]])


def _around(centres: Array, radius: Array) -> Array:
    return np.stack([centres - radius[:, None], centres + radius[:, None]], axis=1)


def _jig_boxes(jig: Jig) -> Array:
    """The boxes (5, 2, 3) around both plates, the strings and both posts.

    Of lines that are no pillar: (1, 2, 3), of the box around all strings and the blocks that hold them.
    """
    if jig.pillar is None:
        half = block_edge_mm(jig) / 2
        points = jig.anchors_mm[jig.used_anchors]
        return np.array([[points.min(axis=0) - half, points.max(axis=0) + half]])
    design = PillarDesign()
    y0, z0, y1, z1 = design.plate(jig).bounds
    h, thick, r = jig.height_mm, design.plate_thickness_mm, design.post_diameter_mm / 2
    plates = [[[-thick, y0, z0], [0.0, y1, z1]], [[h, y0, z0], [h + thick, y1, z1]]]
    strings = [jig.anchors_mm.min(axis=0), jig.anchors_mm.max(axis=0)]
    posts = [[[0.0, y - r, z - r], [h, y + r, z + r]] for y, z in design.posts_yz(jig)]
    return np.array([*plates, strings, *posts])
