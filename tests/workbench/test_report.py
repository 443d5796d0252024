"""The HTML report: self-contained, escaped, and there also when there is no answer."""

from __future__ import annotations

import re
from pathlib import Path

from tests.workbench.helpers import Cli, edit


def test_the_report_stands_alone(cli: Cli, dataset: Path, tmp_path: Path) -> None:
    """No address outside the file, no script, names escaped, one image unreadable."""
    text = (dataset / "cell.toml").read_text()
    name = next(line for line in text.splitlines() if line.startswith("name"))
    edit(dataset / "cell.toml", name, 'name = "<script>alert(1)</script>"')
    (dataset / "images" / "010.png").write_bytes(b"")
    page = tmp_path / "report.html"
    assert cli("calibrate", dataset, "--report", page).code == 0
    html = page.read_text(encoding="utf-8")
    assert "<script" not in html
    assert "&lt;script&gt;" in html
    assert not re.findall(r"""(?:src|href)=["'](?!data:)""", html)
    assert "image_unreadable" in html
    for heading in ("Fig. 7", "95 % interval", "Each location predicted by the others", "Worst frames", "KUKA"):
        assert heading in html


def test_a_report_without_an_answer(cli: Cli, dataset: Path, tmp_path: Path) -> None:
    lines = (dataset / "frames.csv").read_text().splitlines()
    (dataset / "frames.csv").write_text("\n".join(lines[:2]) + "\n")
    page = tmp_path / "report.html"
    assert cli("calibrate", dataset, "--report", page).code == 3
    assert "too_few_poses" in page.read_text(encoding="utf-8")
