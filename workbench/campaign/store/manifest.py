"""run.json: which plan a run's folder belongs to."""

from __future__ import annotations

import json
from pathlib import Path

from geometry import InputError
from workbench.campaign.asked.named import contents
from workbench.campaign.asked.plan import Plan, plan_of
from workbench.files import write_text

NAME, LOCK = "run.json", "run.lock"


def write_manifest(folder: Path, plan: Plan, trials: int) -> None:
    """Write run.json where there is none."""
    if (folder / NAME).exists():
        return
    record = {
        "fingerprint": plan.fingerprint,
        "files": contents(plan),
        "trials": trials,
        "plan": plan.model_dump(mode="json", exclude_unset=True),
    }
    write_text(folder / NAME, json.dumps(record, indent=2, allow_nan=False) + "\n")


def check_manifest(folder: Path, plan: Plan) -> None:
    """InputError where the folder belongs to another plan."""
    record = _record(folder)
    if record["fingerprint"] != plan.fingerprint:
        raise InputError(
            f"{folder}: belongs to another plan, or this plan was changed since the run began; nothing was "
            "touched: give a new folder, or the plan as it was (run.json holds it)"
        )
    _check_files(folder, plan, record)


def check_files_of_run(folder: Path, plan: Plan) -> None:
    """InputError where a file that the plan of a run names is not what it was when the run began."""
    _check_files(folder, plan, _record(folder))


def _check_files(folder: Path, plan: Plan, record: dict[str, object]) -> None:
    before, now = record.get("files"), contents(plan)
    for name, digest in before.items() if isinstance(before, dict) else ():
        if now.get(name) != digest:
            raise InputError(
                f"{folder}: the file of {name} was changed since the run began; nothing was touched: give a new "
                "folder, or the file as it was"
            )


def plan_of_run(folder: Path) -> Plan:
    """The plan of a run's folder; InputError where there is none, or run.json is damaged or of another version."""
    record, path = _record(folder), folder / NAME
    if not isinstance(record["plan"], dict):
        raise InputError(f"{path}: its plan is not a table")
    try:
        plan = plan_of(record["plan"])
    except ValueError as error:
        first = " ".join(str(error).split())[:200]
        raise InputError(f"{path}: its plan can not be read ({first})") from None
    if plan.fingerprint != record["fingerprint"]:
        raise InputError(f"{path}: its plan was changed since, or made by another version of this package")
    return plan


def is_ours(path: Path) -> bool:
    """Whether a run that was killed before its run.json stood may have left ``path`` behind."""
    return path.name == LOCK or path.name.startswith(f".{NAME}.")


def _record(folder: Path) -> dict[str, object]:
    path = folder / NAME
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{folder}: holds no run.json, so it is not the folder of a run") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: can not be read ({error})") from None
    if not isinstance(record, dict) or not {"fingerprint", "trials", "plan"} <= record.keys():
        raise InputError(f"{path}: is not the record of a run")
    return record
