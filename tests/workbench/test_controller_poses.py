"""Poses in controllers' numbers, against scipy's rotations; not proven: that a maker's manual is right."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry import ArmConfiguration, InputError, Pose, parse_bits, parse_letters
from workbench.files import ControllerPoses, PosesSection, controller_poses, read_frames

ATOL = 1e-12
TURNS = np.random.default_rng(0).uniform(-180, 180, (20, 3)) * [1, 0.5, 1]
# what FACTS of the field say: Rz(A)·Ry(B)·Rx(C), and so on, in scipy's words (capitals: about turning axes)
BY_SCIPY = {
    "kuka": lambda a: Rotation.from_euler("ZYX", a, degrees=True),
    "fanuc": lambda a: Rotation.from_euler("xyz", a, degrees=True),
    "yaskawa": lambda a: Rotation.from_euler("xyz", a, degrees=True),
    "mitsubishi": lambda a: Rotation.from_euler("xyz", a, degrees=True),
    "ur": lambda a: Rotation.from_rotvec(np.deg2rad(a)),
}


@pytest.mark.parametrize("convention", BY_SCIPY)
@pytest.mark.parametrize("turn", TURNS)
def test_angles_mean_what_the_maker_means(convention, turn):
    given = np.deg2rad(turn) if convention == "ur" else turn
    pose = ControllerPoses(convention).pose([1.0, 2.0, 3.0, *given])
    np.testing.assert_allclose(pose.R, BY_SCIPY[convention](turn).as_matrix(), rtol=0, atol=ATOL)
    np.testing.assert_array_equal(pose.t, [1.0, 2.0, 3.0])


@pytest.mark.parametrize("turn", TURNS[:5])
def test_quaternions_begin_with_w_at_abb_and_with_x_in_ros(turn):
    rotation = Rotation.from_euler("xyz", turn, degrees=True)
    x, y, z, w = rotation.as_quat()
    for convention, q in (("abb", (w, x, y, z)), ("ros", (x, y, z, w))):
        pose = ControllerPoses(convention, mm=1000.0).pose([0.1, 0.2, 0.3, *q])
        np.testing.assert_allclose(pose.R, rotation.as_matrix(), rtol=0, atol=ATOL)
        np.testing.assert_allclose(pose.t, [100, 200, 300], rtol=0, atol=1e-9)


def test_tool_and_base_are_taken_out():
    """The controller tells the tool in the user frame; the hand in the robot's base is asked for."""
    tool, base = [10.0, -5.0, 200.0, 20.0, -30.0, 40.0], [500.0, 100.0, -50.0, -10.0, 5.0, 90.0]
    said = controller_poses(PosesSection(convention="kuka", tool=tool, base=base))
    rng = np.random.default_rng(1)
    T_base_hand = Pose.exp(rng.normal(size=6))
    plain = ControllerPoses("kuka")
    T_user_tool = plain.given(base).inverse() @ T_base_hand @ plain.given(tool)
    angles = Rotation.from_matrix(T_user_tool.R).as_euler("ZYX", degrees=True)
    found = said.pose([*T_user_tool.t, *angles])
    np.testing.assert_allclose(found.matrix, T_base_hand.matrix, rtol=0, atol=1e-9)


FRAMES = {
    "kuka": ("X,Y,Z,A,B,C,S,T", "1300.5,2,3,10,20,30,2,35", ArmConfiguration(status=2, turn=35)),
    "fanuc": ('X,Y,Z,W,P,R,config', '1300.5,2,3,10,20,30,"N U T, 0, -1, 0"',
              ArmConfiguration(letters="NUT", turns=(0, -1, 0))),
    "abb": ("X,Y,Z,q1,q2,q3,q4,cf1,cf4,cf6,cfx", "1300.5,2,3,1,0,0,0,-1,0,1,0",
            ArmConfiguration(quadrants=(-1, 0, 1, 0))),
    "yaskawa": ("X [mm],Y [mm],Z [mm],RX [deg],RY [deg],RZ [deg]", "1300.5,2,3,10,20,30", None),
    "ros": ("x_mm,y_mm,z_mm,qx,qy,qz,qw", "1300.5,2,3,0,0,0,1", None),
    "ur": ("X,Y,Z,RX,RY,RZ,status", "1300.5,2,3,0.1,0.2,0.3,6", ArmConfiguration(status=6)),
}  # fmt: skip


@pytest.mark.parametrize("convention", FRAMES)
def test_frames_with_the_makers_columns(tmp_path, convention):
    header, row, configuration = FRAMES[convention]
    path = tmp_path / "frames.csv"
    path.write_text(f"frame,profile,location,role,{header}\n1,p/1.csv,A,calibrate,{row}\n")
    (frame,) = read_frames(path, None, poses=ControllerPoses(convention))
    assert frame.T_base_hand.t[0] == 1300.5
    assert frame.configuration == configuration
    assert frame.profile == "p/1.csv"
    with pytest.raises(InputError, match=r"\[poses\] convention" if convention != "ros" else "is missing beside"):
        read_frames(path, None, poses=ControllerPoses("kuka") if convention == "ros" else None)


def test_the_maker_is_never_guessed(tmp_path):
    path = tmp_path / "frames.csv"
    path.write_text("frame,profile,location,role,X,Y,Z,A,B,C\n1,p,A,calibrate,1,2,3,4,5,6\n")
    with pytest.raises(InputError, match=r"\[poses\] convention"):
        read_frames(path, 6)


def test_metres_quaternions_and_rotation_vectors_that_can_not_be(tmp_path):
    path = tmp_path / "frames.csv"
    rows = "".join(f"{k},p,A,calibrate,0.{k},1.2,0.5,10,20,30\n" for k in range(4))
    path.write_text("frame,profile,location,role,X,Y,Z,A,B,C\n" + rows)
    with pytest.raises(InputError, match='unit = "m"'):
        read_frames(path, None, poses=ControllerPoses("kuka"))
    assert read_frames(path, None, poses=ControllerPoses("kuka", 1000.0))[1].T_base_hand.t[0] == 100.0
    with pytest.raises(InputError, match="radians"):
        ControllerPoses("ur").pose([1, 2, 3, 90, 0, 0])
    with pytest.raises(InputError, match="length 2"):
        ControllerPoses("abb").pose([1, 2, 3, 2, 0, 0, 0])
    with pytest.raises(InputError, match="reach"):
        ControllerPoses("fanuc", 1000.0).pose([1300, 2, 3, 0, 0, 0])
    with pytest.raises(InputError, match="tool has 7 numbers"):
        controller_poses(PosesSection(convention="kuka", tool=(0.0,) * 7))


def test_configurations_as_controllers_write_them():
    assert parse_bits("B010") == parse_bits("'B010'") == parse_bits("2") == parse_bits("2.0") == 2
    assert parse_letters("N U T, 0, 0, 0") == ("NUT", (0, 0, 0))
    assert parse_letters("CONFIG : 'F L D B, 1, 0, -1'") == ("FLDB", (1, 0, -1))
    for wrong in ("N F T, 0, 0, 0", "X U T", "0, 0, 0", ""):
        with pytest.raises(InputError):
            parse_letters(wrong)
    with pytest.raises(InputError):
        parse_bits("B012")
