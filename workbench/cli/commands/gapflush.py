"""Gap and flush of two panels."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.table import Table

from workbench.cli import exit_codes
from workbench.cli.console import say_on_stdout, say_remark, standard_error, standard_output

if TYPE_CHECKING:
    from extraction import GapFlush

GapDefinition = Literal["extreme", "tangent", "edge", "fixed_radius", "gauge"]  # as extraction's, whose import is slow


def command(
    profile: Annotated[
        Path, typer.Argument(metavar="PROFILE.csv|IMAGE", help="A profile (columns y_mm, z_mm, …), or an image.")
    ],
    sensor: Annotated[Path | None, typer.Option(help="sensor.toml or preset; needed for an image.")] = None,
    laser_off: Annotated[Path | None, typer.Option(help="The same view without laser, subtracted.")] = None,
    mask: Annotated[Path | None, typer.Option(help="Image that is 0 where pixels must not be used.")] = None,
    config: Annotated[
        list[Path] | None, typer.Option("--config", "--recipe", help="The recipe of all tools, TOML; may be repeated.")
    ] = None,
    definition: Annotated[
        GapDefinition | None,
        typer.Option(help="Between which points gap and flush run; else as \\[gapflush] definition says, or extreme."),
    ] = None,
    tangent_deg: Annotated[
        float | None, typer.Option(min=0, max=90, help="Turn from the face at the tangent point; 0: where it ends.")
    ] = None,
    fixed_radius_mm: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="LEFT RIGHT", help="Known radii of the bends, not fitted then."),
    ] = None,
    gauge_depth_mm: Annotated[
        float | None, typer.Option(min=1e-6, max=1e3, help="How deep a feeler enters below the reference face.")
    ] = None,
    gauge_offset_mm: Annotated[
        float | None, typer.Option(min=0, max=1e3, help="How far inside the other edge a dial gauge's pin stands.")
    ] = None,
    master: Annotated[
        Path | None, typer.Option(help="Profile or image of a master, measured alike; what it is off by is taken out.")
    ] = None,
    master_mm: Annotated[
        tuple[float, float] | None, typer.Option(metavar="GAP FLUSH", help="The master's own, by its certificate.")
    ] = None,
    master_uncertainty_mm: Annotated[
        float, typer.Option(min=0, max=1e3, help="Expanded uncertainty (k = 2) of the master's gap and flush.")
    ] = 0.0,
    picture: Annotated[Path | None, typer.Option(help="PNG or SVG of the points, edges and the two numbers.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Measure gap, flush and edge radii of two panels in a profile, with their standard deviations."""
    from extraction import measure_gap_flush
    from geometry import InputError, json_text
    from workbench.cell import MeasuredProfile, ProfileSource, profile_values, read_profile, value_objects, with_options
    from workbench.files import MeasureConfig, read_settings

    if (master is None) != (master_mm is None):
        raise InputError("--master, what was measured, and --master-mm GAP FLUSH, what is true, belong together")
    settings = read_settings(config or [])
    told = {
        "definition": definition, "tangent_deg": tangent_deg, "fixed_radius_mm": fixed_radius_mm,
        "gauge_depth_mm": gauge_depth_mm, "gauge_offset_mm": gauge_offset_mm,
    }  # fmt: skip
    panels = with_options(settings.gapflush, {k: v for k, v in told.items() if v is not None})
    points = read_profile(ProfileSource(profile, sensor, laser_off, mask, settings), say_remark)
    answer = measure_gap_flush(points, panels)
    if master is not None and master_mm is not None:
        on_master = measure_gap_flush(
            read_profile(ProfileSource(master, sensor, None, mask, settings), say_remark), panels
        )
        answer = answer.against(on_master, master_mm, master_uncertainty_mm)
    if picture is not None:
        from workbench.report import draw_gap_flush

        draw_gap_flush(points, answer, picture, panels.reference)
    if answer.blur_px is None:
        text = "points only, without the stripe's widths and light: the blur's part in the gap is not taken out"
        standard_error().print(text, soft_wrap=True)
    asked = settings.recipe.model_copy(update={"measure": MeasureConfig(gap_and_flush=True)})
    values = profile_values(points, MeasuredProfile(gap=answer), asked)
    broken = [v for v in values if v.lamp == "bad"]
    if as_json:
        judged = {"tolerances": value_objects([v for v in values if v.lamp])} if settings.tolerances.given else {}
        say_on_stdout(json_text(_object(answer, panels.reference) | judged))
    else:
        standard_output().print(_table(answer))
    for value in broken:
        limit = settings.tolerances.given[value.key]
        text = f"{value.key} = {_shown(value.value)}: not within {_shown(limit.min, '…')} and {_shown(limit.max, '…')}"
        standard_error().print(text, markup=False, soft_wrap=True)
    if broken:
        raise typer.Exit(exit_codes.THRESHOLD)


def _shown(value: float | None, nothing: str = "none") -> str:
    return nothing if value is None else f"{value:.4g}"


def _object(answer: GapFlush, reference: str) -> dict[str, Any]:
    return {
        "reference": reference,
        "gap_mm": answer.gap_mm,
        "sigma_gap_mm": answer.sigma_gap_mm,
        "flush_mm": answer.flush_mm,
        "sigma_flush_mm": answer.sigma_flush_mm,
        "radius_mm": answer.radius_mm,
        "sigma_radius_mm": answer.sigma_radius_mm,
        "gap_points_mm": answer.gap_points,
        "flush_points_mm": answer.flush_points,
        "definition": answer.definition,
        "definitions": {
            name: {
                "gap_mm": by.gap_mm,
                "sigma_gap_mm": by.sigma_gap_mm,
                "flush_mm": by.flush_mm,
                "sigma_flush_mm": by.sigma_flush_mm,
                "gap_points_mm": by.gap_points,
                "flush_points_mm": by.flush_points,
            }
            for name, by in answer.definitions.items()
        },
        "blur_px": answer.blur_px,
        "flag": answer.flag,
    }


def _table(answer: GapFlush) -> Table:
    table = Table("", "mm", "σ")
    table.add_row(f"gap, {answer.definition}", f"{answer.gap_mm:.3f}", f"{answer.sigma_gap_mm:.3f}")
    table.add_row(f"flush, {answer.definition}", f"{answer.flush_mm:+.3f}", f"{answer.sigma_flush_mm:.3f}")
    for side, radius, sigma in zip(("left", "right"), answer.radius_mm, answer.sigma_radius_mm, strict=True):
        table.add_row(f"radius {side}", *(("sharp", "") if radius != radius else (f"{radius:.3f}", f"{sigma:.3f}")))
    for name, by in answer.definitions.items():
        if name != answer.definition:
            table.add_row(f"gap, {name}", f"{by.gap_mm:.3f}", f"{by.sigma_gap_mm:.3f}", style="dim")
            table.add_row(f"flush, {name}", f"{by.flush_mm:+.3f}", f"{by.sigma_flush_mm:.3f}", style="dim")
    if answer.flag:
        table.caption = f"doubtful: {answer.flag}"
    return table
