"""The laser stripes of images as profiles."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from workbench.cli import exit_codes
from workbench.cli.console import progress_bar, say_on_stdout, say_remark

if TYPE_CHECKING:
    from workbench.cell import MeasuredStripe


def command(
    images: Annotated[
        list[Path],
        typer.Argument(metavar="IMAGE...", help="Stripe images, or folders of them: PNG, TIFF, BMP; also JPEG."),
    ],
    sensor: Annotated[
        Path | None, typer.Option(help="sensor.toml or preset of the images; without it points are in px.")
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="File for the points; of several images a folder.")] = None,
    ply: Annotated[Path | None, typer.Option(help="File for the points as a PLY cloud; of several a folder.")] = None,
    overlay: Annotated[Path | None, typer.Option(help="PNG of the image with its points; of several a folder.")] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
    laser_off: Annotated[Path | None, typer.Option(help="The same view without laser, subtracted.")] = None,
    mask: Annotated[Path | None, typer.Option(help="Image that is 0 where pixels must not be used.")] = None,
    channel: Annotated[
        Literal["red", "green", "blue", "grey", "max"] | None, typer.Option(help="Channel of colour images.")
    ] = None,
    config: Annotated[
        list[Path] | None, typer.Option("--config", "--recipe", help="The recipe of all tools, TOML; may be repeated.")
    ] = None,
) -> None:
    """Measure the laser stripe of images: points in mm with covariance, in px without a sensor."""
    from geometry import InputError, json_text
    from workbench.cell import (
        StripeInputs,
        is_profile_file,
        measure_stripes,
        stripe_images,
        stripe_record,
    )
    from workbench.files import read_settings

    if csv is None and ply is None and overlay is None and not json_output:
        raise InputError("nothing to write: give --csv, --ply or --overlay FILE, or --json")
    if len(images) == 1 and is_profile_file(images[0]):
        _profile_file(images[0], sensor, csv, ply)
        return
    if ply is not None and sensor is None:
        raise InputError("--ply holds points in mm: it needs --sensor FILE")
    for image in images:
        if is_profile_file(image):
            raise InputError(f"{image} is a profile already; give it alone, or images only")
    paths = stripe_images(images)
    inputs = StripeInputs(sensor, laser_off, mask, channel, read_settings(config or []))
    many = len(paths) > 1 or any(image.is_dir() for image in images)
    records, found = [], 0
    with progress_bar("images", len(paths)) as update:
        for measured in measure_stripes(paths, inputs, say_remark, update):
            _write(measured, csv, ply, overlay, many=many)
            records.append(stripe_record(measured))
            found += len(measured.peaks) > 0
            if many:
                say_remark(_line(measured))
    if not records:
        raise InputError(f"none of the {len(paths)} images can be read")
    if json_output:
        say_on_stdout(json_text({"images": records}))
    if not many:
        written = ", ".join(str(p) for p in (csv, ply, overlay) if p is not None)
        say_remark(f"{written}: {_line(measured)}" if written else _line(measured))
    if found == 0:
        raise typer.Exit(exit_codes.NO_ANSWER)


def _line(measured: MeasuredStripe) -> str:
    """What an image gave: points, how many of them flagged for what, what was refused."""
    from workbench.cell import flag_counts, stripe_record

    if measured.reason:
        return f"{measured.path.name}: {measured.reason}"
    record = stripe_record(measured)
    flags = ", ".join(f"{n} {name}" for name, n in flag_counts(measured.peaks).items())
    refused = ", ".join(f"{n} {name}" for name, n in sorted(measured.peaks.refused.items()))
    text = f"{measured.path.name}: {len(measured.peaks)} points along {record['direction']}, "
    text += f"{record['n_flagged']} flagged" + (f" ({flags})" if flags else "")
    return text + (f"; refused: {refused}" if refused else "")


def _write(measured: MeasuredStripe, csv: Path | None, ply: Path | None, overlay: Path | None, *, many: bool) -> None:
    """The files of one image; of one among several into folders, by the image's name."""
    from extraction import write_peaks_csv, write_profile_csv, write_profile_ply
    from workbench.cell import stripe_overlay
    from workbench.files import write_png

    def place(target: Path, suffix: str) -> Path:
        if not many:
            return target
        target.mkdir(parents=True, exist_ok=True)
        return target / f"{measured.path.stem}{suffix}"

    if csv is not None:
        if measured.profile is None:
            write_peaks_csv(measured.peaks, place(csv, ".csv"))
        else:
            write_profile_csv(measured.profile, place(csv, ".csv"))
    if ply is not None and measured.profile is not None:
        write_profile_ply(measured.profile, place(ply, ".ply"))
    if overlay is not None:
        write_png(place(overlay, ".png"), stripe_overlay(measured))


def _profile_file(path: Path, sensor: Path | None, csv: Path | None, ply: Path | None) -> None:
    """A maker's profile file, its points checked against the sensor, as our CSV or PLY."""
    from extraction import write_profile_csv, write_profile_ply
    from workbench.cell import ProfileSource, read_profile

    profile = read_profile(ProfileSource(path, sensor), say_remark)
    if csv is not None:
        write_profile_csv(profile, csv)
    if ply is not None:
        write_profile_ply(profile, ply)
    say_remark(f"{path}: {len(profile)} points")
