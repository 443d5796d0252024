"""Show or export a string jig."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from workbench import defaults
from workbench.cli.console import say_on_stdout, standard_error, standard_output

if TYPE_CHECKING:
    from jig_cad import Jig


def command(
    jig: Annotated[
        str, typer.Argument(metavar="FILE|PRESET", help="A jig.toml, or the name of a preset.")
    ] = defaults.JIG,
    export: Annotated[
        list[Path] | None,
        typer.Option(help="Write the jig as .stl, .glb or .svg (drawing); may be repeated."),
    ] = None,
    toml: Annotated[bool, typer.Option("--toml", help="Print the jig as a jig.toml to start from.")] = False,
) -> None:
    """Show a string jig: its size, strings and anchors; or export it as STL, GLB or drawing."""
    from jig_cad import export_jig, jig_text
    from workbench.cell import find_jig

    found = find_jig(jig)
    if toml:
        say_on_stdout(jig_text(found).rstrip("\n"))
    elif not export:
        _show(found)
    for path in export or []:
        export_jig(found, path)
        standard_error().print(f"{path} written", markup=False)


def _show(jig: Jig) -> None:
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
        anchors.add_row(escape(name), *(f"{v:.3f}" for v in point))
    console.print(strings)
    console.print(anchors)
