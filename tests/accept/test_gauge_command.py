"""`accept gauge`: tables as people have them, the record, exit codes, and a sentence for each bad table."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.accept.aiag import VALUES, long_table
from tests.workbench.helpers import Cli


def wide_table() -> str:
    lines = ["Teil;Prüfer;1;2;3;remark"]
    cells = (([f"P{i}", "ABC"[j]], VALUES[i, j]) for i in range(10) for j in range(3))
    lines += [";".join([*names, *(f"{x:.2f}".replace(".", ",") for x in values), ""]) for names, values in cells]
    return "\n".join(lines)


@pytest.mark.parametrize(
    "text", [long_table(), long_table(";", ","), long_table("\t"), wide_table(), long_table().replace("part", "Sample")]
)
def test_tables_of_every_kind_give_the_same(cli: Cli, tmp_path: Path, text: str) -> None:
    path = tmp_path / "study.csv"
    path.write_text(text, encoding="utf-8")
    result = cli("accept", "gauge", path, "--json")
    assert result.code == 0
    assert result.json["figures"]["GRR"]["value"] == pytest.approx(0.302373, abs=5e-6)
    assert result.json["verdict"]["code"] == "no_limits"


def test_columns_by_other_names(cli: Cli, tmp_path: Path) -> None:
    path = tmp_path / "study.csv"
    path.write_text(long_table().replace("value", "gap_mm").replace("operator", "robot"), encoding="utf-8")
    result = cli("accept", "gauge", path, "--value", "gap_mm", "--operator", "robot", "--json")
    assert result.json["operators"] == 3
    assert result.json["figures"]["ndc"]["value"] == 4


@pytest.mark.parametrize(
    ("options", "code", "verdict"),
    [
        (("--max-grr-percent", "30"), 1, "not_proven"),
        (("--max-grr-percent", "30", "--rule", "simple"), 0, "conform"),
        (("--max-grr-percent", "30", "--rule", "nonconformity"), 0, "not_proven"),
        (("--max-grr-percent", "10"), 1, "nonconform"),
        (("--max-grr-percent", "90"), 0, "conform"),
        (("--min-ndc", "5", "--rule", "simple"), 1, "nonconform"),
        (("--tolerance-mm", "8", "--min-cg", "1.1"), 0, "conform"),
        (("--tolerance-mm", "8", "--min-cgk", "1.1"), 1, "not_proven"),
    ],
)
def test_limits_and_exit_codes(cli: Cli, tmp_path: Path, options: tuple[str, ...], code: int, verdict: str) -> None:
    path, out, report = (tmp_path / name for name in ("study.csv", "record.json", "record.html"))
    path.write_text(long_table(), encoding="utf-8")
    result = cli("accept", "gauge", path, *options, "--out", out, "--report", report, "--remark", "line 3 <b>")
    assert result.code == code
    record = json.loads(out.read_text(encoding="utf-8"))
    assert record["verdict"]["code"] == verdict
    assert record["checks"][0]["passed"] == (code == 0)
    assert record["inputs"][0]["sha256"]
    page = report.read_text(encoding="utf-8")
    assert "line 3 &lt;b&gt;" in page
    assert "part × operator" in page
    assert f"verdict: {verdict}" in result.out


def test_a_table_without_operators(cli: Cli, tmp_path: Path) -> None:
    rows = ["part,value", *(f"{i},{x:.2f}" for i in range(10) for x in VALUES[i, 0])]
    path = tmp_path / "study.csv"
    path.write_text("\n".join(rows), encoding="utf-8")
    record = cli("accept", "gauge", path, "--json").json
    assert record["figures"]["AV"]["value"] is None
    assert record["figures"]["GRR"]["value"] == record["figures"]["EV"]["value"]
    assert any("without operators" in note for note in record["notes"])


LINES = long_table().splitlines()
BAD = {
    "unbalanced": ("\n".join(LINES[:-1]), 'part "10" by operator "C" has 2 trials, where others have 3'),
    "missing cell": ("\n".join(x for x in LINES if not x.startswith("4,B")), 'part "4" by operator "B" is missing'),
    "one operator": (long_table(values=VALUES[:, :1]), 'one operator only ("A")'),
    "letters": (long_table().replace("-0.56", "n/a", 1), 'line 11, column value: "n/a" is not a number'),
    "empty": (long_table().replace("-0.56", "", 1), "line 11, column value: is empty"),
    "sentinel": (long_table().replace("-0.56", "-9999", 1), "mark for a missing value"),
    "constants": (long_table(values=np.ones((3, 2, 2))), "all 12 values are 1"),
    "copied trials": (long_table(values=np.repeat(VALUES[:, :, :1], 3, axis=2)), "agree to the last digit"),
    "one part": (long_table(values=VALUES[:1]), 'one part only ("1")'),
    "one trial": (long_table(values=VALUES[:, :, :1]), "at least 2 trials"),
    "twice": (long_table() + "1,A,1,0.3\n", 'trial "1" of part "1" by operator "A" stands in line 2 too'),
    "no value": (long_table().replace("value", "wort"), 'the column "value" is missing'),
    "no part": (long_table().replace("part", "thing"), 'the column "part" is missing'),
    "header only": ("part,operator,value\n", "holds no measurements"),
    "two references": ("part,value,reference\n1,1,1\n1,2,3\n2,1,1\n2,3,1\n", 'part "1" has the reference 1'),
    "nothing": ("", "the file is empty"),
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
def test_bad_tables_end_in_a_sentence(cli: Cli, tmp_path: Path, kind: str) -> None:
    text, words = BAD[kind]
    path = tmp_path / "study.csv"
    path.write_text(text, encoding="utf-8")
    result = cli("accept", "gauge", path)
    assert result.code == 2
    assert result.out == ""
    assert words in result.err
    assert len(result.err.strip().splitlines()) == 1 + (kind in ("no value", "no part") and "ignored" in result.err)


def test_cg_needs_a_tolerance(cli: Cli, tmp_path: Path) -> None:
    result = cli("accept", "gauge", tmp_path / "none.csv", "--min-cg", "1.33")
    assert result.code == 2
    assert "--tolerance-mm" in result.err
