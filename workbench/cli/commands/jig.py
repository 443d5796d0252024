"""Show, draw or export a target; take in what a measuring machine found of it."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from workbench import defaults
from workbench.cli.console import say_on_stdout, say_remark, standard_error, standard_output

if TYPE_CHECKING:
    from geometry import Target
    from jig_cad import Jig


def command(
    jig: Annotated[
        str, typer.Argument(metavar="FILE|PRESET", help="A jig.toml or target.toml, or the name of a preset.")
    ] = defaults.JIG,
    export: Annotated[
        list[Path] | None,
        typer.Option(
            help="Write the workshop's drawing (.svg, .dxf), or a jig's solids (.stl, .glb); may be repeated."
        ),
    ] = None,
    anchors: Annotated[
        Path | None, typer.Option(help="CSV of a measuring machine: name, x_mm, y_mm, z_mm of anchors or balls.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Write the target, with --anchors as measured, to this .toml.")
    ] = None,
    sensor: Annotated[str | None, typer.Option(help="Whether this sensor sees the jig whole: file or preset.")] = None,
    toml: Annotated[bool, typer.Option("--toml", help="Print the target's file to start from.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Show a target: size, strings, anchors; draw it for a workshop; take in what a measuring machine found of it."""
    from geometry import InputError, json_text
    from jig_cad import Balls, Jig, export_target, jig_text
    from workbench.cell import find_target
    from workbench.files import target_text, write_text

    if toml and as_json:
        raise InputError("--toml and --json both fill standard output: give one of them")
    if out is not None and out.suffix.lower() != ".toml":
        raise InputError(f"--out {out}: the target is written as .toml; drawings and solids are written by --export")
    found, told = find_target(jig), AskedBeside(as_json)
    if anchors is not None:
        if not isinstance(found, Jig | Balls):
            raise InputError(f"--anchors: {jig} is neither a string jig nor balls: nothing of it has a measured place")
        found = _as_measured(found, anchors, told)
    if sensor is not None:
        _tell_whether_seen(found, sensor, told)
    text = jig_text(found) if isinstance(found, Jig) else target_text(found)
    if as_json:
        say_on_stdout(json_text(_target_object(found) | told.answers))
    elif toml:
        say_on_stdout(text.rstrip("\n"))
    elif not (export or out or sensor or anchors):
        _show(found)
    if out is not None:
        write_text(out, text)
        standard_error().print(f"{out} written", markup=False)
    for path in export or []:
        export_target(found, path)
        standard_error().print(f"{path} written", markup=False)


@dataclass(frozen=True)
class AskedBeside:
    """What the options asked: kept for the JSON object, or said at once."""

    as_json: bool
    answers: dict[str, Any] = field(default_factory=dict)


def _target_object(target: Target) -> dict[str, Any]:
    """A target as JSON: of a string jig its size, strings and anchors, of others what their file holds."""
    from jig_cad import Jig
    from workbench.files import target_text

    if not isinstance(target, Jig):
        return tomllib.loads(target_text(target))
    ends = zip(target.strings, target.start_index, target.end_index, target.lengths, strict=True)
    return {
        "name": target.name,
        "kind": "strings",
        "side_mm": target.side_mm,
        "height_mm": target.height_mm,
        "string_diameter_mm": target.string_diameter_mm,
        "tolerance_mm": target.tolerance_mm,
        "measured": target.measured,
        "strings": [
            {"string": label, "from": target.anchors[a], "to": target.anchors[b], "length_mm": float(length)}
            for label, a, b, length in ends
        ],
        "anchors_mm": dict(zip(target.anchors, target.anchors_mm.tolist(), strict=True)),
    }


def _as_measured(target: Any, anchors: Path, told: AskedBeside) -> Any:
    from workbench.files import lay_onto

    measured = lay_onto(target, anchors, say_remark)
    if told.as_json:
        deviations = dict(zip(measured.names, measured.deviation_mm.tolist(), strict=True))
        told.answers["less_drawn"] = {"rms_mm": measured.rms_mm, "deviation_mm": deviations}
        return measured.target
    table = Table("name", "x", "y", "z", title="measured less drawn \\[mm]", title_justify="left")
    for name, deviation in zip(measured.names, measured.deviation_mm, strict=True):
        table.add_row(escape(name), *(f"{v:+.3f}" for v in deviation))
    console = standard_output()
    console.print(table)
    console.print(f"rms {measured.rms_mm:.3f} mm after the best rigid motion onto the drawing")
    return measured.target


def _tell_whether_seen(target: Target, name: str, told: AskedBeside) -> None:
    from geometry import InputError
    from jig_cad import Jig
    from workbench.cell import find_sensor
    from workbench.plan import plan_limits, seen_whole

    if not isinstance(target, Jig):
        raise InputError("--sensor: only a string jig must be seen whole; of a ball or a plate a part is enough")
    sensor = find_sensor(name)
    whole = seen_whole(sensor, target, plan_limits())
    if told.as_json:
        told.answers["seen_whole"] = bool(whole.fits)
        return
    standard_output().print(
        f"{sensor.name or name} sees the jig whole" if whole.fits else whole.sentence(sensor, target),
        markup=False,
        soft_wrap=True,
    )


def _show(target: Target) -> None:
    from jig_cad import Jig
    from workbench.files import target_text

    if isinstance(target, Jig):
        _show_jig(target)
    else:
        say_on_stdout(target_text(target).rstrip("\n"))


def _show_jig(jig: Jig) -> None:
    console = standard_output()
    console.print(
        f"{jig.name or 'string jig'}: side {jig.side_mm:g} mm, height {jig.height_mm:g} mm, "
        f"string {jig.string_diameter_mm:g} mm, tolerance {jig.tolerance_mm:g} mm "
        f"({'anchors measured' if jig.measured else 'anchors as drawn'})",
        markup=False,
        soft_wrap=True,
    )
    strings = Table("string", "from", "to", "length [mm]".replace("[", "\\["))
    for k, (label, length) in enumerate(zip(jig.strings, jig.lengths, strict=True)):
        ends = (jig.anchors[jig.start_index[k]], jig.anchors[jig.end_index[k]])
        strings.add_row(*map(escape, (label, *ends)), f"{length:.3f}")
    anchors = Table("anchor", "x", "y", "z", title="anchors in {J} \\[mm]", title_justify="left")
    for name, point in zip(jig.anchors, jig.anchors_mm, strict=True):
        anchors.add_row(escape(name), *(f"{v:z.3f}" for v in point))
    console.print(strings)
    console.print(anchors)
