"""robot.toml (docs/formats.md): a Denavit-Hartenberg table or a URDF, with what it does not know of itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from geometry import (
    DH_ROWS,
    TYPICAL_SIGMA,
    Arm,
    Compliance,
    Compliant,
    DhRobot,
    InputError,
    Remark,
    RobotUncertainty,
    assumed_compliance,
    compliant_part,
    no_remark,
    toml_value,
)
from workbench.files.strict import FileSection, NotNegative, Real, Text, Whole, validate
from workbench.files.toml_text import read_toml

_URAD = 1e-6
_DIGITS = 6  # of compliance in files: far below its σ


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


class ComplianceSection(FileSection):
    """[compliance]: how joints give way under gravity, and the masses that load them; one number a joint.

    balanced: the share of a joint's torque that a compensator carries. up: against gravity in the base. sigma_urad_nm:
    one number for all joints, or one each; where it is absent half the compliance, or the assumed one where that is 0.
    """

    compliance_urad_nm: tuple[Real, ...] | None = None
    sigma_urad_nm: NotNegative | tuple[NotNegative, ...] | None = None
    mass_kg: tuple[NotNegative, ...] | None = None
    payload_kg: NotNegative | None = None
    balanced: tuple[NotNegative, ...] | None = None
    up: tuple[Real, Real, Real] = (0.0, 0.0, 1.0)


class RobotFile(FileSection):
    """The keys of robot.toml: either [[joint]] tables or urdf, base, tip."""

    convention: Text = "standard"
    joint: tuple[JointSection, ...] = ()
    coupling: CouplingSection | None = None
    urdf: Text | None = None
    base: Text | None = None
    tip: Text | None = None
    uncertainty: UncertaintySection = Field(default_factory=UncertaintySection)
    compliance: ComplianceSection | None = None


def read_robot(path: Path, remark: Remark = no_remark) -> Arm:
    """The robot of a robot.toml: a table of joints, or a chain of a URDF, with the compliance of its joints if stated.

    Parameters
    ----------
    path
        The file.
    remark
        Told of what is doubtful in a URDF.

    Returns
    -------
    Arm
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
            return _loaded(_from_urdf(file, path, remark), file.compliance)
        if not file.joint:
            raise InputError("no [[joint]] tables: one for each joint is needed, or urdf, base and tip")
        return _loaded(_from_table(file), file.compliance)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _loaded(table: DhRobot, given: ComplianceSection | None) -> Arm:
    """The table, or the arm whose joints give way as [compliance] says."""
    if given is None:
        return table
    n, assumed = table.n_joints, assumed_compliance(table)
    for key in ("compliance_urad_nm", "sigma_urad_nm", "mass_kg", "balanced"):
        value = getattr(given, key)
        if isinstance(value, tuple) and len(value) != n:
            raise InputError(f"[compliance] {key} has {len(value)} values for {n} joints")
    up = np.array(given.up)
    if not np.linalg.norm(up) > 0:
        raise InputError("[compliance] up = [0, 0, 0]: must point against gravity, [0, 0, 1] for an arm that stands")
    if given.balanced is not None and max(given.balanced) > 1:
        raise InputError(f"[compliance] balanced = {max(given.balanced):g}: must be a share, 0 to 1")
    compliance = _URAD * np.array(given.compliance_urad_nm or (0.0,) * n)
    usual = np.where(compliance != 0, np.abs(compliance) / 2, 1 / np.array(assumed.stiffness))
    sigma = usual if given.sigma_urad_nm is None else np.broadcast_to(_URAD * np.array(given.sigma_urad_nm), n)
    with np.errstate(divide="ignore"):
        stiffness = tuple(float(k) for k in 1 / compliance)
    load = Compliance(
        stiffness,
        mass_kg=assumed.mass_kg if given.mass_kg is None else given.mass_kg,
        payload_kg=assumed.payload_kg if given.payload_kg is None else given.payload_kg,
        balanced=assumed.balanced if given.balanced is None else given.balanced,
        up=tuple((up / np.linalg.norm(up)).tolist()),
    )
    return Compliant(table, load, tuple(sigma.tolist()))


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
    from workbench.files.robots.urdf import read_urdf

    model = read_urdf(path.parent / str(file.urdf), file.base, file.tip, remark)
    return replace(model, uncertainty=_uncertainty(file.uncertainty), name=file.name or model.name)


def robot_text(arm: Arm) -> str:
    """The robot as the text of a robot.toml with [[joint]] tables; angles survive to 1e-12°."""
    robot, compliant = arm.dh_part(), compliant_part(arm)
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
    lines += [] if compliant is None else _compliance_lines(compliant)
    return "\n".join(lines) + "\n"


def _compliance_lines(arm: Compliant) -> list[str]:
    load = arm.load

    def urad(values: NDArray[np.float64]) -> str:
        return toml_value([float(f"{v / _URAD:.{_DIGITS}g}") + 0.0 for v in values])

    sigma = np.broadcast_to(np.asarray(arm.sigma, dtype=float), arm.n_joints)
    return [
        "[compliance]        # joints give way under gravity: angle = compliance * torque of the masses",
        f"compliance_urad_nm = {urad(1 / np.array(load.stiffness))}",
        f"sigma_urad_nm = {urad(sigma)}",
        f"mass_kg = {toml_value([float(m) for m in load.mass_kg])}",
        f"payload_kg = {float(load.payload_kg)!r}",
        f"balanced = {toml_value([float(b) for b in load.balanced])}",
        f"up = {toml_value([float(v) for v in load.up])}",
    ]
