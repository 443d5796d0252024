"""The SCP as a tool frame in the words of a robot's controller, with the formula of its numbers in a comment."""

from __future__ import annotations

from collections.abc import Callable

from geometry import CONVENTIONS, Pose, express

NAME = "laser sensor"


def controller_text(pose: Pose, maker: str, about: str) -> str:
    """The tool frame T_hand_sensor as ``maker`` takes it.

    Parameters
    ----------
    pose
        T_hand_sensor: the frame {P} in the frame of the robot file's last link.
    maker
        A key of CONTROLLERS.
    about
        One line on where the numbers come from.

    Returns
    -------
    str
        Text to be pasted into the controller's file or program, comments first.

    """
    convention = CONVENTIONS[maker]
    comment, body = CONTROLLERS[maker]
    numbers = [value + 0.0 for value in express(pose, maker).values()]
    unit = "mm" if convention.length_mm == 1 else "m"
    angles = "" if maker in ("abb", "ur") else " and degrees"
    lines = [
        f"{NAME}: T_hand_sensor as a tool frame of {convention.maker}, {unit}{angles}",
        convention.formula,
        "p_hand = R p_sensor + t; hand: the frame of the robot file's last link, which must be the controller's flange",
        about,
    ]
    return "".join(f"{comment} {_ascii(line)}\n" for line in lines) + body(numbers) + "\n"


def _kuka(v: list[float]) -> str:
    x, y, z, a, b, c = v
    frame = f"{{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.6f},B {b:.6f},C {c:.6f}}}"
    return f'TOOL_DATA[1]={frame}\nTOOL_NAME[1,]="laser"\nTOOL_TYPE[1]=#BASE'


def _fanuc(v: list[float]) -> str:
    x, y, z, w, p, r = v
    return (
        "P[1]{\n   GP1:\n    UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0',\n"
        f"    X = {x:.4f} mm, Y = {y:.4f} mm, Z = {z:.4f} mm,\n"
        f"    W = {w:.6f} deg, P = {p:.6f} deg, R = {r:.6f} deg\n}};\n! then: PR[1]=P[1] ; UTOOL[1]=PR[1] ;"
    )


def _abb(v: list[float]) -> str:
    x, y, z, *q = v
    quaternion = ",".join(f"{n:.9f}" for n in q)
    frame = f"[[{x:.4f},{y:.4f},{z:.4f}],[{quaternion}]]"
    return f"PERS tooldata tLaser:=[TRUE,{frame},[1,[0,0,1],[1,0,0,0],0,0,0]];"


def _yaskawa(v: list[float]) -> str:
    return "//TOOL 1\n///NAME LASER\n" + ",".join(f"{n:.4f}" for n in v)


def _ur(v: list[float]) -> str:
    return "set_tcp(p[" + ", ".join(f"{n:.9f}" for n in v) + "])"


CONTROLLERS: dict[str, tuple[str, Callable[[list[float]], str]]] = {
    "kuka": (";", _kuka),
    "fanuc": ("!", _fanuc),
    "abb": ("!", _abb),
    "yaskawa": ("'", _yaskawa),
    "ur": ("#", _ur),
}


def _ascii(text: str) -> str:
    """Controllers read ASCII."""
    return text.replace("·", " * ").replace("°", " deg").replace("σ", "sigma").encode("ascii", "replace").decode()
