"""The laser stripe of an image as a profile."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workbench.cli import exit_codes
from workbench.cli.console import say_remark, standard_error


def command(
    image: Annotated[
        Path, typer.Argument(metavar="IMAGE", help="A stripe image: PNG, TIFF or BMP; JPEG with a remark.")
    ],
    sensor: Annotated[Path | None, typer.Option(help="sensor.toml of that image; of a profile file optional.")] = None,
    csv: Annotated[Path | None, typer.Option(help="File for the points with their covariance.")] = None,
    ply: Annotated[Path | None, typer.Option(help="File for the points as a PLY cloud.")] = None,
    laser_off: Annotated[Path | None, typer.Option(help="The same view without laser, subtracted.")] = None,
    mask: Annotated[Path | None, typer.Option(help="Image that is 0 where pixels must not be used.")] = None,
    config: Annotated[list[Path] | None, typer.Option(help="Settings TOML with \\[stripe]; may be repeated.")] = None,
) -> None:
    """Measure the laser stripe of an image: points (y, z) of the laser plane with covariance, as CSV or PLY."""
    from extraction import write_profile_csv, write_profile_ply
    from geometry import InputError
    from workbench.cell import ProfileSource, read_profile, read_profile_settings

    if csv is None and ply is None:
        raise InputError("nothing to write: give --csv FILE, --ply FILE or both")
    profile = read_profile(
        ProfileSource(image, sensor, laser_off, mask, read_profile_settings(config or [])), say_remark
    )
    if csv is not None:
        write_profile_csv(profile, csv)
    if ply is not None:
        write_profile_ply(profile, ply)
    flagged = int((profile.peaks.flag > 0).sum())
    written = ", ".join(str(p) for p in (csv, ply) if p is not None)
    standard_error().print(f"{written}: {len(profile)} points, {flagged} flagged", soft_wrap=True, markup=False)
    if len(profile) == 0 and sensor is not None:
        standard_error().print(_why_empty(image, sensor), soft_wrap=True, markup=False)
        raise typer.Exit(exit_codes.NO_ANSWER)


def _why_empty(image: Path, sensor: Path) -> str:
    from extraction.spots import FLOODED_SHARE
    from workbench.files import read_image, read_sensor

    model = read_sensor(sensor)
    full = model.require_camera().saturation_dn
    if (read_image(image, model, lossy=True) >= full).mean() > FLOODED_SHARE:
        return f"no stripe: more than half of the image is saturated ({full}), lower the exposure"
    return "no stripe in the image: see [stripe] direction, min_run, max_width_px"
