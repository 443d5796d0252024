"""The columns of a campaign's tables."""

from __future__ import annotations

import pyarrow as pa

from workbench.campaign.asked.plan import Plan, Range
from workbench.campaign.asked.settings import TrialSettings, is_whole

PARQUET = {"compression": "zstd", "write_page_checksum": True}  # how all tables are written
_REAL, _WHOLE, _TEXT, _LIST = pa.float64(), pa.int64(), pa.string(), pa.list_(pa.float64())

_KEY = [("trial", _WHOLE), ("point", _WHOLE), ("repeat", _WHOLE), ("seed", _WHOLE)]
_RESULT = [
    ("verdict", _TEXT),
    ("message", _TEXT),
    ("chi2_per_dof", _REAL),
    ("error_mm", _REAL),  # length of the SCP's translation error
    ("error_deg", _REAL),  # angle of its rotation error
    ("nees", _REAL),  # ξᵀ Σ⁻¹ ξ of the SCP's error, 6 degrees of freedom
    ("error", _LIST),  # ξ (6): mm, rad, sensor axes
    ("covariance", _LIST),  # of ξ, 36 numbers by rows
    ("T_hand_sensor", _LIST),  # estimate, 16 numbers by rows
    ("T_hand_sensor_true", _LIST),
    ("sigma_mm", _REAL),  # √(trace) of the translation's covariance
    ("sigma_deg", _REAL),
    ("frames_used", _WHOLE),
    ("spots_visible", _WHOLE),
    ("spots_found", _WHOLE),
    ("points_false", _WHOLE),
    ("points_mislabelled", _WHOLE),
    ("point_bias_y_mm", _REAL),
    ("point_bias_z_mm", _REAL),
    ("point_rms_y_mm", _REAL),
    ("point_rms_z_mm", _REAL),
    ("pose_rms_mm", _REAL),
    ("pose_rms_deg", _REAL),
    ("verify_max_deviation_mm", _REAL),
    ("verify_point_rms_mm", _REAL),
    ("tilt_max_deg", _REAL),
]
FRAME_SCHEMA = pa.schema(
    [
        ("trial", _WHOLE),
        ("frame", _WHOLE),
        ("location", _TEXT),
        ("role", _TEXT),
        ("used", pa.bool_()),
        ("reason", _TEXT),
        ("joints_deg", _LIST),
        ("T_sensor_jig_true", _LIST),
        ("tilt_deg", _REAL),
        ("visible", _WHOLE),
        ("found", _WHOLE),
        ("false_points", _WHOLE),
        ("mislabelled", _WHOLE),
        ("bias_y_mm", _REAL),
        ("bias_z_mm", _REAL),
        ("rms_y_mm", _REAL),
        ("rms_z_mm", _REAL),
        ("pose_error_mm", _REAL),
        ("pose_error_deg", _REAL),
    ]
)
TIMING_SCHEMA = pa.schema(
    [("trial", _WHOLE), ("plan_s", _REAL), ("render_s", _REAL), ("extract_s", _REAL), ("calibrate_s", _REAL)]
)


def trial_schema(plan: Plan) -> pa.Schema:
    """Columns of the trials' table: key, every factor by its dotted name, results."""
    return pa.schema([*_KEY, *((name, _kind(plan, name)) for name in plan.factors), *_RESULT])


def _kind(plan: Plan, name: str) -> pa.DataType:
    factor = plan.factors[name]
    if isinstance(factor, Range):
        return _WHOLE if is_whole(TrialSettings, name) else _REAL
    if all(isinstance(v, bool) for v in factor):
        return pa.bool_()
    if any(isinstance(v, str) for v in factor):
        return _TEXT
    return _WHOLE if is_whole(TrialSettings, name) else _REAL
