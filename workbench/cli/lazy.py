"""A typer group whose commands are imported only when they are called, so that help comes at once."""

from __future__ import annotations

import importlib
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

COMMANDS = {
    "demo": "The paper's experiment in emulation: render, extract, calibrate, compare with Table 1 and Fig. 7.",
    "calibrate": "Solve the sensor's pose in the hand from a cell dataset.",
    "verify": "Judge an SCP on a dataset without solving: figures by location, with a limit for your own CI.",
    "compare": "The difference of two calibrations with its σ: did anything move?",
    "extract": "Find string points in images and write them as CSV.",
    "profile": "Measure the laser stripe of images: points in mm, or in px without a sensor; CSV, PLY, overlays.",
    "convert": "Convert profile files from one maker's format to another's.",
    "gapflush": "Measure gap, flush and edge radii of two panels in a profile or an image.",
    "tune": "Tune detection on saved stripe images: the process window in the browser, or a search with --auto.",
    "pose": "All jig poses that fit the points of a frame, with their likelihoods.",
    "accept": "Acceptance tests with a record: ball, sphere spacing, flatness, repeatability, gauge R&R.",
    "twin": "Fit a sensor's emulation keys to its recorded stripe images, and show what still differs.",
    "calibrate-sensor": "Calibrate a self-built sensor from pictures of a board with the stripe on it.",
    "validate": "Measure point extraction against truth, with thresholds for your own CI.",
    "plan": "Propose the most telling next configurations and predict the SCP's σ.",
    "render": "Record a cell in emulation: plan configurations and render images with truth.",
    "closure": "Fit a robot to a point that stands still, joint readings alone; judged on unseen locations.",
    "paper": "Repeat the paper's experiment as an ensemble: Table 1, Fig. 7, and what explains them.",
    "jig": "Show a target, draw it for a workshop, export it, or take in its measured anchors.",
    "init": "Write a commented starter dataset to fill in.",
    "datasheet": "Write the sensor.toml of a line profiler from its data sheet alone.",
    "sweep": "Run a campaign of many pixel-to-transform trials from a plan; resumes.",
    "report": "One HTML page of a campaign: accuracy against every factor.",
    "doctor": "Check the installation, or a dataset file by file, and say what is missing.",
}


class LazyGroup(TyperGroup):
    """Lists COMMANDS with their help; ``workbench.cli.commands.NAME`` is imported when NAME is called."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = {name: TyperCommand(name, help=text, short_help=text) for name, text in COMMANDS.items()}

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that ``args`` names, imported now."""
        name, found, rest = super().resolve_command(ctx, args)
        return name, load(name) if found is not None and name is not None else found, rest


def load(name: str) -> Any:
    """The command ``name``, made of ``command`` in its module, or the group ``app`` of a command with several tests."""
    module = importlib.import_module(f"workbench.cli.commands.{name.replace('-', '_')}")
    if hasattr(module, "app"):
        return typer.main.get_command(module.app)
    single = typer.Typer(add_completion=False, rich_markup_mode="rich")
    single.command(name, help=getattr(module.command, "__doc__", None))(module.command)
    return typer.main.get_command(single)
