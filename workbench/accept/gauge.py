"""The record of a gauge study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from geometry import Remark, no_remark
from workbench.accept.figures import Limit, Rule
from workbench.accept.gauge_study import study_gauge
from workbench.accept.gauge_table import GaugeColumns, read_gauge_table
from workbench.accept.record import Record, make_record
from workbench.accept.variance import POOL_ABOVE

STANDARD = "AIAG MSA, 4th ed. (analysis of variance); ISO 22514-7 and VDA 5 have the same study"


def accept_gauge(
    path: Path,
    columns: GaugeColumns | None = None,
    limits: Sequence[Limit] = (),
    rule: Rule = "conformity",
    tolerance_mm: float | None = None,
    pool_above: float = POOL_ABOVE,
    remarks: Sequence[str] = (),
    remark: Remark = no_remark,
) -> Record:
    """Gauge R&R of a table, with Cg and Cgk where a tolerance and reference values are known.

    Parameters
    ----------
    path, columns
        The table, and its columns' names.
    limits, rule
        What is asked, and what passes.
    tolerance_mm
        Full width of what is tolerated.
    pool_above
        The interaction is pooled where its p-value is above.
    remarks
        The user's own words for the record.
    remark
        Told of what is ignored.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        Where the table is no balanced study.

    """
    table = read_gauge_table(path, columns, remark)
    study = study_gauge(table, tolerance_mm, pool_above)
    c = study.components
    rows = [
        {
            "source": s.name,
            "dof": s.dof,
            "sum_of_squares": s.sum_of_squares,
            "mean_square": s.mean_square,
            "F": s.f,
            "p": s.p,
        }
        for s in c.table
    ]
    used = [{"source": s.name, "dof": s.dof, "mean_square": s.mean_square, "F": s.f, "p": s.p} for s in c.used]
    parts, operators, trials = table.values.shape
    details = {
        "parts": parts,
        "operators": len(table.operators),
        "trials": trials,
        "tolerance_mm": tolerance_mm,
        "anova": rows,
        "pooled": c.pooled,
        "interaction_p": c.interaction_p,
        "pool_above": pool_above,
        "components_from": used,
        "variance_mm2": c.variance,
        "operator_means_mm": dict(zip(table.operators, table.values.mean(axis=(0, 2)), strict=True))
        if table.operators
        else {},
        "part_means_mm": dict(zip(table.parts, table.values.mean(axis=(1, 2)), strict=True)),
    }
    shape = (
        f"{parts} parts × {operators} operators × {trials} trials"
        if table.operators
        else f"{parts} parts × {trials} trials"
    )
    return make_record(
        "gauge", f"gauge study, {shape}", STANDARD, study.figures, limits, rule, [path],
        details=details, notes=study.notes, remarks=remarks,
    )  # fmt: skip
