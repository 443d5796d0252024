"""The images of one trial, made again from the plan, byte for byte."""

from __future__ import annotations

from pathlib import Path

from geometry import InputError, NoAnswerError
from workbench.campaign.asked.plan import Plan, read_plan
from workbench.campaign.asked.trials import n_trials, trial_seed, trial_settings
from workbench.campaign.store.manifest import check_files_of_run, plan_of_run
from workbench.campaign.trial.trial import image_name, png, trial_frames
from workbench.files import write_bytes


def remake_trial(plan_or_run: Path, trial: int, out: Path) -> int:
    """Write the images of ``trial`` into ``out``, the same files as a run keeps; returns how many.

    plan_or_run: the plan's file or a run's folder. Raises InputError for a trial that the plan does not have and
    NoAnswerError for one that found no configurations and so has no images.
    """
    plan = _plan(plan_or_run)
    size = n_trials(plan)
    if not 0 <= trial < size:
        raise InputError(f"{plan_or_run}: has no trial {trial}, its trials are 0 … {size - 1}")
    _, settings = trial_settings(plan, trial)
    count = 0
    for configuration, frame in trial_frames(settings, plan.run, trial_seed(plan, trial)):
        write_bytes(out / image_name(configuration.frame), png(frame))
        count += 1
    if count == 0:
        raise NoAnswerError(f"trial {trial} found no robot configurations that see the jig, so it has no images")
    return count


def _plan(path: Path) -> Plan:
    if not path.is_dir():
        return read_plan(path)
    plan = plan_of_run(path)
    check_files_of_run(path, plan)
    return plan
