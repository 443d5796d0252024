"""Campaigns: a plan of many pixel-to-transform trials on all cores or a cluster, resumable, always the same bytes."""

from workbench.campaign.advice import advice, reached
from workbench.campaign.emulated import EmulatedCell, emulated_cell
from workbench.campaign.page import write_page
from workbench.campaign.plan import Plan, read_plan
from workbench.campaign.remake import remake_trial
from workbench.campaign.runner import run_campaign
from workbench.campaign.settings import TrialSettings
from workbench.campaign.summary import (
    LEVEL,
    AskedAccuracy,
    Run,
    consistency,
    proportion_band,
    quantile_band,
    read_run,
    verdicts,
)
from workbench.campaign.trial import render_frame

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
    "proportion_band",
    "quantile_band",
    "reached",
    "read_plan",
    "read_run",
    "remake_trial",
    "render_frame",
    "run_campaign",
    "verdicts",
    "write_page",
]
