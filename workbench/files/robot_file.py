"""robot.toml (docs/formats.md): a Denavit-Hartenberg table or a URDF, with what it does not know of itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from geometry import DH_ROWS, TYPICAL_SIGMA, DhRobot, InputError, Remark, RobotUncertainty, no_remark, toml_value
from workbench.files.strict import FileSection, NotNegative, Real, Text, Whole, validate
from workbench.files.toml_text import read_toml


class JointSection(FileSection):
    """One [[joint]]: angle = sign · reading + theta_offset; beta_deg is Hayati's parameter of a calibrated table."""

    theta_offset_deg: Real = 0.0
    d_mm: Real = 0.0
    a_mm: Real = 0.0
    alpha_deg: Real = 0.0
    beta_deg: Real = 0.0
    sign: Whole = 1
    min_deg: Real | None = None
    max_deg: Real | None = None

    @model_validator(mode="after")
    def _plausible(self) -> JointSection:
        if self.sign not in (-1, 1):
            raise ValueError(f"has sign = {self.sign}: 1 or -1 is right")
        if self.min_deg is not None and self.max_deg is not None and self.min_deg >= self.max_deg:
            raise ValueError(f"has min_deg = {self.min_deg:g} ≥ max_deg = {self.max_deg:g}: the limits leave no angle")
        return self


class CouplingSection(FileSection):
    """[coupling]: joint angles = matrix @ readings, for arms whose motors move more than one joint."""

    matrix: tuple[tuple[Real, ...], ...]


class UncertaintySection(FileSection):
    """[uncertainty]: standard deviations of the joints and of the table."""

    joint_sigma_deg: NotNegative = TYPICAL_SIGMA["joint_sigma_deg"]
    theta_sigma_deg: NotNegative = TYPICAL_SIGMA["theta_sigma_deg"]
    d_sigma_mm: NotNegative = TYPICAL_SIGMA["d_sigma_mm"]
    a_sigma_mm: NotNegative = TYPICAL_SIGMA["a_sigma_mm"]
    alpha_sigma_deg: NotNegative = TYPICAL_SIGMA["alpha_sigma_deg"]


class RobotFile(FileSection):
    """The keys of robot.toml: either [[joint]] tables or urdf, base, tip."""

    convention: Text = "standard"
    joint: tuple[JointSection, ...] = ()
    coupling: CouplingSection | None = None
    urdf: Text | None = None
    base: Text | None = None
    tip: Text | None = None
    uncertainty: UncertaintySection = Field(default_factory=UncertaintySection)


def read_robot(path: Path, remark: Remark = no_remark) -> DhRobot:
    """The robot of a robot.toml: a table of joints, or a chain of a URDF.

    Parameters
    ----------
    path
        The file.
    remark
        Told of what is doubtful in a URDF.

    Returns
    -------
    DhRobot
        With the standard deviations of its [uncertainty].

    Raises
    ------
    InputError
        Naming file, line and key.

    """
    source = read_toml(path)
    file = validate(RobotFile, source)
    try:
        if file.urdf is not None:
            return _from_urdf(file, path, remark)
        if not file.joint:
            raise InputError("no [[joint]] tables: one for each joint is needed, or urdf, base and tip")
        return _from_table(file)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


@dataclass(frozen=True)
class UrdfChain:
    """A URDF file and the first and last link of the robot in it."""

    path: Path
    base: str
    tip: str


def urdf_of(path: Path) -> UrdfChain | None:
    """The URDF that a robot.toml names, or None where it holds a table."""
    file = validate(RobotFile, read_toml(path))
    if file.urdf is None or file.base is None or file.tip is None:
        return None
    return UrdfChain(path.parent / file.urdf, file.base, file.tip)


def _uncertainty(section: UncertaintySection) -> RobotUncertainty:
    return RobotUncertainty.from_file({key: getattr(section, key) for key in TYPICAL_SIGMA})


def _from_table(file: RobotFile) -> DhRobot:
    if file.base is not None or file.tip is not None:
        raise InputError("base and tip belong to a urdf, which is not given")
    columns = {row.column: row.from_file([getattr(j, row.file_key) for j in file.joint]) for row in DH_ROWS}
    return DhRobot.from_dh(
        **columns,
        sign=np.array([j.sign for j in file.joint], dtype=float),
        min_rad=np.deg2rad([-np.inf if j.min_deg is None else j.min_deg for j in file.joint]),
        max_rad=np.deg2rad([np.inf if j.max_deg is None else j.max_deg for j in file.joint]),
        convention=file.convention,
        coupling=_coupling(file),
        uncertainty=_uncertainty(file.uncertainty),
        name=file.name,
    )


def _coupling(file: RobotFile) -> NDArray[np.float64] | None:
    n = len(file.joint)
    if file.coupling is None:
        return None
    rows = file.coupling.matrix
    if len(rows) != n or any(len(row) != n for row in rows):
        raise InputError(f"[coupling] matrix must be {n} × {n}, one row and column for each [[joint]]")
    matrix = np.array(rows, dtype=float)
    if abs(np.linalg.det(matrix)) < 1e-9:
        raise InputError("[coupling] matrix is singular: the joints could not be told from the readings")
    return matrix


def _from_urdf(file: RobotFile, path: Path, remark: Remark) -> DhRobot:
    if file.joint or file.coupling:
        raise InputError("gives both urdf and [[joint]] or [coupling]: only one of the two can be the robot")
    if file.base is None or file.tip is None:
        raise InputError("a urdf needs base and tip, the names of the chain's first and last link")
    from workbench.files.urdf import read_urdf

    model = read_urdf(path.parent / str(file.urdf), file.base, file.tip, remark)
    return replace(model, uncertainty=_uncertainty(file.uncertainty), name=file.name or model.name)


def robot_text(robot: DhRobot) -> str:
    """The robot as the text of a robot.toml with [[joint]] tables; angles survive to 1e-12°."""
    if robot.T_base_first.log().any() or robot.T_last_hand.log().any():
        raise InputError("a robot with fixed poses before or after its links (from a URDF) has no [[joint]] table form")
    lines = [f"name = {toml_value(robot.name)}"] if robot.name else []
    lines += [f"convention = {toml_value(robot.convention)}"]
    for i in range(robot.n_joints):
        lines.append("[[joint]]")
        for row in DH_ROWS:
            value = float(row.to_file(getattr(robot, row.column)[i]))
            shown = round(value, 13) if row.unit == "rad" else value
            lines += [f"{row.file_key} = {shown!r}"] if row.group != "beta" or value else []
        lines += [f"sign = {int(robot.sign[i])}"] if robot.sign[i] != 1 else []
        limits = zip(("min_deg", "max_deg"), robot.stated_limits, strict=True)
        lines += [f"{key} = {round(float(np.rad2deg(v[i])), 12)!r}" for key, v in limits if np.isfinite(v[i])]
    if robot.coupling is not None:
        lines += ["[coupling]", f"matrix = {toml_value(robot.coupling.tolist())}"]
    lines.append("[uncertainty]")
    for key, sigma in robot.uncertainty.in_file_units.items():
        lines.append(f"{key} = {round(sigma, 12) if key.endswith('_deg') else sigma!r}")
    return "\n".join(lines) + "\n"
