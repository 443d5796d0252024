"""Campaigns: a plan of many pixel-to-transform trials on all cores or a cluster, resumable, always the same bytes."""

from workbench.campaign.asked.plan import Plan, read_plan
from workbench.campaign.asked.settings import TrialSettings
from workbench.campaign.results.advice import advice, reached
from workbench.campaign.results.page import run_object, write_page
from workbench.campaign.results.summary import (
    LEVEL,
    AskedAccuracy,
    Run,
    consistency,
    proportion_band,
    quantile_band,
    read_run,
    verdicts,
)
from workbench.campaign.trial.emulated import EmulatedCell, emulated_cell
from workbench.campaign.trial.trial import render_frame
from workbench.campaign.work.remake import remake_trial
from workbench.campaign.work.runner import run_campaign
from workbench.campaign.work.warm import end_warm_server

__all__ = [
    "LEVEL",
    "AskedAccuracy",
    "EmulatedCell",
    "Plan",
    "Run",
    "TrialSettings",
    "advice",
    "consistency",
    "emulated_cell",
    "end_warm_server",
    "proportion_band",
    "quantile_band",
    "reached",
    "read_plan",
    "read_run",
    "remake_trial",
    "render_frame",
    "run_campaign",
    "run_object",
    "verdicts",
    "write_page",
]
