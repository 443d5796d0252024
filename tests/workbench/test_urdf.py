"""URDF arms: read as Denavit-Hartenberg models and written back corrected, against a chain multiplied out by itself."""

import re
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytransform3d.urdf import UrdfTransformManager

from geometry import DH_ROWS, InputError, Pose, robot_from_axes
from workbench.cell import find_robot
from workbench.cell.starter import write_starter
from workbench.files import read_robot, robot_text, write_urdf
from workbench.files.robots.urdf import read_urdf, urdf_ends

ATOL_MM = 1e-8
ATOL_ROTATION = 1e-12
SEEDS = st.integers(0, 2**32 - 1)

Spec = list[tuple[str, tuple[float, ...], tuple[float, ...], tuple[float, ...] | None]]  # type, xyz m, rpy, axis

SIX: Spec = [
    ("fixed", (0.1, -0.2, 0.5), (0.0, 0.0, 0.3), None),
    ("revolute", (0, 0, 0.29), (0, 0, 0), (0, 0, 1)),
    ("revolute", (0, 0, 0), (0, 0, 0), (0, 1, 0)),
    ("revolute", (0, 0, 0.27), (0, 0, 0), (0, 1, 0)),
    ("fixed", (0, 0, 0.07), (0, 0, 0), None),
    ("revolute", (0.1, 0, 0), (0, 0, 0), (1, 0, 0)),
    ("continuous", (0.202, 0, 0), (0, 0, 0), (0, 1, 0)),
    ("revolute", (0.072, 0, 0), (0, 0, 0), (1, 0, 0)),
    ("fixed", (0, 0, 0), (0, 1.5707963267948966, 0), None),
]
SEVEN: Spec = [
    ("revolute", (0, 0, 0.333), (0, 0, 0), (0, 0, 1)),
    ("revolute", (0, 0, 0), (-1.570796327, 0, 0), (0, 0, 1)),
    ("revolute", (0, -0.316, 0), (1.570796327, 0, 0), (0, 0, 1)),
    ("revolute", (0.0825, 0, 0), (1.570796327, 0, 0), (0, 0, 1)),
    ("revolute", (-0.0825, 0.384, 0), (-1.570796327, 0, 0), (0, 0, 1)),
    ("revolute", (0, 0, 0), (1.570796327, 0, 0), (0, 0, 1)),
    ("revolute", (0.088, 0, 0), (1.570796327, 0, 0), (0, 0, 1)),
    ("fixed", (0, 0, 0.107), (0, 0, 0), None),
]


def urdf_text(spec: Spec, extra: str = "") -> str:
    """A URDF of links L0 … Ln in a row."""
    links = "".join(f'<link name="L{i}"/>' for i in range(len(spec) + 1))
    joints = ""
    for i, (kind, xyz, rpy, axis) in enumerate(spec):
        place = f'<origin xyz="{" ".join(map(repr, xyz))}" rpy="{" ".join(map(repr, rpy))}"/>'
        turn = f'<axis xyz="{" ".join(map(repr, axis))}"/>' if axis else ""
        limit = '<limit lower="-2.5" upper="2.7" effort="0" velocity="1"/>' if kind == "revolute" else ""
        ends = f'<parent link="L{i}"/><child link="L{i + 1}"/>'
        joints += f'<joint name="J{i}" type="{kind}">{place}{ends}{turn}{limit}</joint>\n'
    return f'<?xml version="1.0"?>\n<robot name="arm">\n{links}\n{joints}{extra}</robot>\n'


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' formula, written out here."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def chain(spec: Spec, q: np.ndarray) -> np.ndarray:
    """The tip's pose [mm] as the product of every joint's origin and turn: no DH in it."""
    out, left = np.eye(4), list(q)
    for _, xyz, rpy, axis in spec:
        step = np.eye(4)
        step[:3, :3] = turn((0, 0, 1), rpy[2]) @ turn((0, 1, 0), rpy[1]) @ turn((1, 0, 0), rpy[0])
        step[:3, 3] = np.array(xyz) * 1000
        if axis is not None:
            step[:3, :3] = step[:3, :3] @ turn(np.array(axis), left.pop(0))
        out = out @ step
    return out


def random_spec(rng: np.random.Generator, joints: int) -> Spec:
    """Skew, parallel, nearly parallel, coinciding and opposite axes in any order, with fixed joints between."""
    spec: Spec = []
    for _ in range(joints):
        if rng.random() < 0.3:
            spec.append(("fixed", tuple(rng.uniform(-0.3, 0.3, 3)), tuple(rng.uniform(-1, 1, 3)), None))
        kind = rng.choice(["skew", "parallel", "nearly", "same", "opposite", "crossing"])
        xyz, rpy = rng.uniform(-0.5, 0.5, 3), rng.uniform(-1.5, 1.5, 3)
        axis = np.array([0.0, 0, 1])
        if kind == "skew":
            axis = rng.normal(size=3)
        elif kind in ("parallel", "opposite"):
            rpy, axis = np.zeros(3), axis * (1 if kind == "parallel" else -1)
        elif kind == "nearly":
            rpy = rng.uniform(-1, 1, 3) * rng.choice([1e-9, 1e-6, 1e-3, 0.019, 0.021])
        elif kind == "same":
            xyz, rpy = np.array([0, 0, xyz[2]]), np.zeros(3)
        else:
            xyz = np.zeros(3)
        spec.append(("revolute", tuple(map(float, xyz)), tuple(map(float, rpy)), tuple(map(float, axis))))
    if rng.random() < 0.6:
        spec.append(("fixed", tuple(rng.uniform(-0.3, 0.3, 3)), tuple(rng.uniform(-1, 1, 3)), None))
    return spec


def write(folder: Path, text: str) -> Path:
    path = folder / "arm.urdf"
    path.write_text(text)
    return path


@pytest.mark.parametrize(("spec", "joints"), [(SIX, 6), (SEVEN, 7)])
def test_arms_of_six_and_seven_joints_are_read_exactly(tmp_path: Path, spec: Spec, joints: int) -> None:
    robot = read_urdf(write(tmp_path, urdf_text(spec)), "L0", f"L{len(spec)}")
    assert robot.n_joints == joints
    q = np.random.default_rng(1).uniform(-2.5, 2.7, (200, joints))
    for row in q:
        np.testing.assert_allclose(robot.pose(row).matrix[:3, 3], chain(spec, row)[:3, 3], rtol=0, atol=ATOL_MM)
        np.testing.assert_allclose(robot.pose(row).R, chain(spec, row)[:3, :3], rtol=0, atol=ATOL_ROTATION)


def test_limits_and_plain_rows_come_out_as_written(tmp_path: Path) -> None:
    """An arm whose base is its first axis needs no pose before its table; continuous joints turn ± 360°."""
    robot = read_urdf(write(tmp_path, urdf_text(SIX)), "L1", "L9")
    np.testing.assert_allclose(robot.T_base_first.matrix, np.eye(4), rtol=0, atol=0)
    np.testing.assert_allclose(robot.d, [290, 0, 0, 302, 0, 72], rtol=0, atol=1e-9)
    np.testing.assert_allclose(robot.a, [0, 270, 70, 0, 0, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(robot.min_rad[[0, 4]], [-2.5, -2 * np.pi], rtol=0, atol=0)
    np.testing.assert_allclose(robot.max_rad[[0, 4]], [2.7, 2 * np.pi], rtol=0, atol=0)


@given(SEEDS, st.integers(1, 8))
@settings(max_examples=80, deadline=None)
def test_any_chain_of_axes_is_held_by_a_table(seed: int, joints: int) -> None:
    rng = np.random.default_rng(seed)
    spec = random_spec(rng, joints)
    frames, axes, here = [], [], np.eye(4)
    for part in spec:
        here = here @ chain([part], np.zeros(1))
        if part[3] is not None:
            frames.append(here[:3, 3])
            axes.append(here[:3, :3] @ np.array(part[3]))
    robot = robot_from_axes(np.array(frames), np.array(axes), Pose.from_matrix(here))
    assert np.abs(robot.d).max() < 1e5  # nothing runs away where axes are nearly parallel
    for q in rng.uniform(-3, 3, (4, joints)):
        np.testing.assert_allclose(robot.pose(q).matrix, chain(spec, q), rtol=0, atol=1e-7)


def test_an_independent_urdf_reader_agrees(tmp_path: Path) -> None:
    path = write(tmp_path, urdf_text(SIX))
    robot, manager = read_urdf(path, "L0", "L9"), UrdfTransformManager()
    manager.load_urdf(path.read_text())
    names = [f"J{i}" for i, part in enumerate(SIX) if part[3] is not None]
    q = np.random.default_rng(3).uniform(-2, 2, 6)
    for name, value in zip(names, q, strict=True):
        manager.set_joint(name, value)
    theirs = manager.get_transform("L9", "L0")
    np.testing.assert_allclose(robot.pose(q).R, theirs[:3, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(robot.pose(q).t, theirs[:3, 3] * 1000, rtol=0, atol=1e-6)


@pytest.mark.parametrize(("spec", "tip"), [(SIX, "L9"), (SIX, "L8"), (SEVEN, "L8"), (SEVEN, "L7")])
def test_a_corrected_arm_is_written_back_exactly(tmp_path: Path, spec: Spec, tip: str) -> None:
    """Also where the tip hangs directly on the last joint, and the file's other links stay."""
    path = write(tmp_path, urdf_text(spec, '<link name="camera"/><!-- kept link -->'))
    nominal, rng = read_urdf(path, "L0", tip), np.random.default_rng(4)
    scale = np.array([[1e-3], [0.3], [0.3], [1e-3], [1e-4]])
    errors = scale * rng.normal(size=(5, nominal.n_joints))
    corrected = nominal.with_changes(**{row.group: e for row, e in zip(DH_ROWS, errors, strict=True)})
    target = tmp_path / "out" / "corrected.urdf"
    write_urdf(path, "L0", tip, corrected, target)
    again = read_urdf(target, "L0", tip)
    q = rng.uniform(-2.5, 2.5, (50, nominal.n_joints))
    np.testing.assert_allclose(again.pose(q).matrix, corrected.pose(q).matrix, rtol=0, atol=1e-7)
    assert np.abs(again.pose(q).t - nominal.pose(q).t).max() > 0.1
    assert 'name="camera"' in target.read_text()


def test_writing_the_nominal_arm_changes_nothing(tmp_path: Path) -> None:
    path = write(tmp_path, urdf_text(SIX))
    robot = read_urdf(path, "L0", "L9")
    write_urdf(path, "L0", "L9", robot, tmp_path / "same.urdf")
    again = read_urdf(tmp_path / "same.urdf", "L0", "L9")
    for field in ("theta_offset", "d", "a", "alpha"):
        np.testing.assert_allclose(getattr(again, field), getattr(robot, field), rtol=0, atol=1e-9)


def test_a_robot_toml_may_name_a_urdf(tmp_path: Path) -> None:
    write(tmp_path, urdf_text(SEVEN))
    (tmp_path / "robot.toml").write_text(
        'urdf = "arm.urdf"\nbase = "L0"\ntip = "L8"\n[uncertainty]\nd_sigma_mm = 0.3\n'
    )
    robot = read_robot(tmp_path / "robot.toml")
    assert robot.n_joints == 7
    assert robot.uncertainty.d_sigma_mm == 0.3
    np.testing.assert_allclose(robot.pose(np.zeros(7)).t, [88, 0, 333 + 316 + 384 - 107], rtol=0, atol=1e-5)


LOOP = SIX[:2]
ENTITY = '<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY e SYSTEM "file:///etc/passwd">]><robot name="x">&e;</robot>'


@pytest.mark.parametrize(
    ("text", "ends", "message"),
    [
        ("<robot", "L0 L9", "line 1: is not well-formed"),
        ("<sdf/>", "L0 L9", "outermost element is <sdf>"),
        (ENTITY, "L0 L9", "declares (DTD|Entities)"),
        (urdf_text(SIX), "base L9", 'no link "base" for base'),
        (urdf_text(SIX), "L0 L99", 'no link "L99" for tip, did you mean "L9"'),
        (urdf_text(SIX), "L9 L0", 'no chain leads from link "L9" to "L0"'),
        (urdf_text(SIX), "L0 L1", "no joint moves"),
        (urdf_text(SIX), "L0 L0", "no joint moves"),
        (urdf_text(SIX).replace('type="continuous"', 'type="prismatic"'), "L0 L9", 'joint "J6" is of type "prismatic"'),
        (urdf_text(SIX).replace('<link name="L4"/>', ""), "L0 L9", 'joint "J3" names the link "L4", which is missing'),
        (urdf_text(SIX, '<link name="L4"/>'), "L0 L9", 'link "L4" is declared twice'),
        (urdf_text(SIX).replace('<parent link="L0"/>', '<parent link="L9"/>'), "L5 L9", None),
        (urdf_text(SIX).replace('<parent link="L0"/>', '<parent link="L9"/>'), "L0 L9", "form a loop"),
        (urdf_text(SIX).replace('<child link="L5"/>', '<child link="L6"/>'), "L0 L9", 'link "L6" hangs on two joints'),
        (
            urdf_text(SIX).replace('xyz="0 0 0.27"', 'xyz="0 0 nan"'),
            "L0 L9",
            'joint "J3": xyz="0 0 nan" must be 3 finite',
        ),
        (urdf_text(SIX).replace('xyz="0 0 0.27"', 'xyz="0 zero 0.27"'), "L0 L9", "must be 3 numbers"),
        (urdf_text(SIX).replace('xyz="0 0 0.27"', 'xyz="0 0.27"'), "L0 L9", "must be 3 finite numbers"),
        (
            urdf_text(SIX).replace('<axis xyz="1 0 0"/>', '<axis xyz="0 0 0"/>'),
            "L0 L9",
            'joint "J7" has an axis of length 0',
        ),
        (urdf_text(SIX).replace('upper="2.7"', 'upper="-2.7"'), "L0 L9", "leave no angle"),
        (urdf_text(SIX).replace('xyz="0 0 0.27"', 'xyz="${x} 0 0"'), "L0 L9", "xacro"),
        (urdf_text(SIX).replace('<child link="L3"/>', '<mimic joint="J1"/><child link="L3"/>'), "L0 L9", "mimics"),
        ("", "L0 L9", "empty"),
    ],
)
def test_faults_are_named(tmp_path: Path, text: str, ends: str, message: str | None) -> None:
    path = write(tmp_path, text)
    if message is None:  # what lies off the chain may be as it likes
        assert read_urdf(path, *ends.split()).n_joints == 3
        return
    with pytest.raises(InputError, match=message) as caught:
        read_urdf(path, *ends.split())
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_arm_of_another_shape_is_not_written(tmp_path: Path) -> None:
    path = write(tmp_path, urdf_text(SIX))
    other = read_urdf(path, "L0", "L6")
    with pytest.raises(InputError, match="4 joints, the URDF's chain 6"):
        write_urdf(path, "L0", "L9", other, tmp_path / "no.urdf")
    assert not (tmp_path / "no.urdf").exists()


def test_a_limit_that_nobody_wrote_leaves_out_nothing(tmp_path: Path) -> None:
    """Continuous joints have none, nor has a revolute one without <limit>; stated ones hold."""
    text = urdf_text(SIX).replace('<limit lower="-2.5" upper="2.7" effort="0" velocity="1"/>', "", 1)
    robot = read_urdf(write(tmp_path, text), "L0", "L9")
    turned = np.array([40.0, 0, 0, 0, -40.0, 0])
    assert bool(robot.within_limits(turned))
    assert not bool(robot.within_limits(turned + np.array([0, 2.8, 0, 0, 0, 0])))
    low, high = robot.stated_limits
    assert list(np.isinf(low)) == list(np.isinf(high)) == [True, False, False, False, True, False]
    assert np.all(np.isfinite([robot.min_rad, robot.max_rad]))


def test_a_table_without_limits_has_none(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("[[joint]]\nd_mm = 100\nmin_deg = -10\n[[joint]]\na_mm = 100\n")
    robot = read_robot(path)
    assert bool(robot.within_limits(np.deg2rad([900.0, -900.0])))
    assert not bool(robot.within_limits(np.deg2rad([-11.0, 0.0])))
    again = tmp_path / "again.toml"
    again.write_text(robot_text(robot))
    assert read_robot(again).unstated == robot.unstated == ((False, True), (True, True))


@pytest.mark.parametrize(
    ("rpy", "named"),
    [
        ("1.57 0 0", ["1.57"]),
        ("0 -1.571 3.14", ["-1.571", "3.14"]),
        ("0.785 0.524 0", ["0.785", "0.524"]),
        ("1.5707963 0 3.141592653589793", []),
        ("1.5708 0 -0.7854", []),
        ("0.3 1.5 0.123", []),
        ("1.57123456 0 0", []),
    ],
)
def test_angles_of_few_digits_are_named(tmp_path: Path, rpy: str, named: list[str]) -> None:
    said: list[str] = []
    read_urdf(write(tmp_path, urdf_text(SIX).replace('rpy="0.0 0.0 0.3"', f'rpy="{rpy}"')), "L0", "L9", said.append)
    assert bool(said) == bool(named)
    for word in named:
        assert f"{word} of J0" in said[0]


@pytest.mark.parametrize("encoding", ["ISO-8859-1", "windows-1252", "utf-16", "UTF-8", "gbk"])
def test_declared_encodings(tmp_path: Path, encoding: str) -> None:
    name = "中" if encoding == "gbk" else "Universität"
    text = urdf_text(SIX).replace("?>", f' encoding="{encoding}"?><!-- {name} ${{xacro}} in a comment -->', 1)
    path = tmp_path / "arm.urdf"
    path.write_bytes(text.encode(encoding))
    assert read_urdf(path, "L0", "L9").n_joints == 6


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (b'<?xml version="1.0"?><robot name="a" xmlns:xacro="http://ros.org"><xacro:arm/></robot>', "is a xacro"),
        (b'<robot name="a"><xacro:include filename="b"/></robot>', "is a xacro"),
        (b'<robot name="a"><link name="$(arg x)"/></robot>', "xacro expressions"),
        (b'<?xml version="1.0" encoding="klingon"?><robot name="a"/>', 'encoding "klingon"'),
        ('<?xml version="1.0"?><robot name="ä"/>'.encode("latin-1"), "line 1: is not text in its encoding, utf-8"),
        (b'<?xml version="1.0" encoding="punycode"?><robot name="a"/>', 'encoding "punycode"'),
    ],
)
def test_what_a_text_is_not(tmp_path: Path, raw: bytes, message: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_bytes(raw)
    with pytest.raises(InputError, match=re.escape(message)):
        read_urdf(path, "L0", "L9")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [('xyz="0 0 0.27"', 'xyz="0 0 270"', "lengths are metres"), ('rpy="0.0 0.0 0.3"', 'rpy="0 0 90"', "radians")],
)
def test_units_that_no_urdf_has(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_urdf(write(tmp_path, urdf_text(SIX).replace(old, new)), "L0", "L9")


def test_thirty_thousand_links_in_linear_time(tmp_path: Path) -> None:
    """Comparing each link with each would take a minute."""
    more = "".join(
        f'<link name="M{i}"/><joint name="N{i}" type="fixed"><parent link="L0"/><child link="M{i}"/></joint>'
        for i in range(30_000)
    )
    start = time.process_time()
    assert read_urdf(write(tmp_path, urdf_text(SIX, more)), "L0", "L9").n_joints == 6
    assert time.process_time() - start < 6.0


def test_an_arm_is_found_in_its_urdf_and_starts_a_dataset(tmp_path: Path) -> None:
    path = write(tmp_path, urdf_text(SIX)).rename(tmp_path / "arm.urdf")
    assert urdf_ends(path) == ("L0", "L9")
    whole = find_robot(str(path))
    np.testing.assert_array_equal(whole.d, read_urdf(path, "L0", "L9").d)
    write_starter(tmp_path / "cell", str(path), "nominal", "paper")
    started = read_robot(tmp_path / "cell" / "robot.toml")
    q = np.linspace(-1.0, 1.0, started.n_joints)
    np.testing.assert_array_equal(started.pose(q).matrix, whole.pose(q).matrix)


def test_the_hand_is_tool0_or_the_only_one(tmp_path: Path) -> None:
    camera = '<link name="eye"/><joint name="JE" type="fixed"><parent link="L9"/><child link="eye"/></joint>'
    bolt = '<link name="bolt"/><joint name="JB" type="fixed"><parent link="L9"/><child link="bolt"/></joint>'
    both = urdf_text(SIX, camera + bolt)
    with pytest.raises(InputError, match=r"2 links could be the hand: bolt, eye; write a robot\.toml"):
        urdf_ends(write(tmp_path, both))
    assert urdf_ends(write(tmp_path, both.replace("eye", "tool0"))) == ("L0", "tool0")
    with pytest.raises(InputError, match="2 links hang on no joint"):
        urdf_ends(write(tmp_path, urdf_text(SIX, '<link name="alone"/>')))


def test_a_name_with_a_line_end_is_said_on_one_line(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text('urdf = "ar\\nm.urdf"\nbase = "L0"\ntip = "L8"\n', encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_robot(path)
    assert "ar\\nm.urdf" in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1
