"""What a measuring machine found of anchors and balls: laid onto the drawing, and named where it can not be so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from geometry import Pose
from jig_cad import Balls, Jig, sample_tolerance
from tests.workbench.helpers import Cli
from workbench.files import read_jig_file, read_target, target_text

ATOL_MM = 1e-3
MACHINE = Pose.exp(np.array([412.0, -80.0, 25.0, 0.3, -0.9, 1.4]))  # where the jig lay on it


def _csv(path: Path, names: tuple[str, ...], points: np.ndarray, separator: str = ",", head: str = "name") -> Path:
    rows = [separator.join([n, *(f"{v:.4f}" for v in p)]) for n, p in zip(names, points, strict=True)]
    path.write_text(separator.join([head, "x_mm", "y_mm", "z_mm"]) + "\n" + "\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize("head", ["name", "Anchor"])
def test_distances_between_anchors_are_those_measured(cli: Cli, tmp_path: Path, head: str) -> None:
    """Whatever axes the machine had, and the anchors lie as near to the drawing as their tolerance."""
    made = sample_tolerance(Jig.nominal(), np.random.default_rng(5))
    csv = _csv(tmp_path / "cmm.csv", made.anchors, MACHINE @ made.anchors_mm, ";", head)
    result = cli("jig", "--anchors", csv, "--out", tmp_path / "jig.toml")
    assert result.code == 0, result.err
    read = read_jig_file(tmp_path / "jig.toml")
    assert read.measured

    def apart(points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points[:, None] - points, axis=-1)

    np.testing.assert_allclose(apart(read.anchors_mm), apart(made.anchors_mm), rtol=0, atol=ATOL_MM)
    assert np.max(np.abs(read.anchors_mm - read.nominal_anchors_mm)) < 0.1


def test_balls_take_their_measured_centres_and_diameters(cli: Cli, tmp_path: Path) -> None:
    balls = Balls.of({"a": (30, (-40, 0, 0)), "b": (30, (40, 0, 0)), "c": (30, (0, 50, 0))})
    (tmp_path / "target.toml").write_text(target_text(balls))
    moved = MACHINE @ (balls.centres_mm + np.array([[0, 0, 0.2], [0.1, 0, 0], [0, 0, 0]]))
    rows = "\n".join(f"{n},{p[0]:.4f},{p[1]:.4f},{p[2]:.4f},29.98" for n, p in zip("abc", moved, strict=True))
    (tmp_path / "cmm.csv").write_text(f"ball,x_mm,y_mm,z_mm,diameter_mm\n{rows}\n")
    out = tmp_path / "measured.toml"
    result = cli("jig", tmp_path / "target.toml", "--anchors", tmp_path / "cmm.csv", "--out", out)
    assert result.code == 0, result.err
    read = read_target(out)
    assert isinstance(read, Balls)
    np.testing.assert_allclose(read.diameters_mm, 29.98, rtol=0, atol=1e-9)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        wanted = np.linalg.norm(moved[i] - moved[j])
        np.testing.assert_allclose(np.linalg.norm(read.centres_mm[i] - read.centres_mm[j]), wanted, atol=ATOL_MM)


def test_what_can_not_be_laid_onto_the_drawing_is_named(cli: Cli, tmp_path: Path) -> None:
    jig = Jig.nominal(90.0, 130.0)
    (tmp_path / "jig.toml").write_text(
        "side_mm = 90.0\nheight_mm = 130.0\nstring_diameter_mm = 0.3\ntolerance_mm = 0.1\n"
    )
    points = MACHINE @ jig.anchors_mm
    swapped = points[[1, 0, 2, 3, 4, 5]]
    cases = {
        "names are swapped": (jig.anchors, swapped),
        "left-handed": (jig.anchors, points * [1, -1, 1]),
        "millimetres are right": (jig.anchors, points / 1000),
        "anchor Ct was not measured": (jig.anchors[:5], points[:5]),
        "another target": (jig.anchors, points + np.random.default_rng(0).uniform(-30, 30, points.shape)),
    }
    for words, (names, where) in cases.items():
        csv = _csv(tmp_path / "cmm.csv", names, where)
        result = cli("jig", tmp_path / "jig.toml", "--anchors", csv, "--out", tmp_path / "out.toml")
        assert result.code == 2, words
        assert words in result.err
        assert not (tmp_path / "out.toml").exists()
    twice = _csv(tmp_path / "cmm.csv", ("Ab", "Ab"), points[:2])
    assert "stands in two rows" in cli("jig", "--anchors", twice).err


def test_a_jig_is_held_against_a_sensor(cli: Cli, tmp_path: Path) -> None:
    assert "sees the jig whole" in cli("jig", "--sensor", "nominal").out
    begun = cli("init", tmp_path / "cell", "--sensor", "lmi_gocator_2330")
    assert "can not see a jig of side 100 mm" in begun.err
    told = cli("jig", "--sensor", "lmi_gocator_2330")
    assert told.code == 0
    assert "fits" in told.out
    (tmp_path / "target.toml").write_text('kind = "sphere"\ndiameter_mm = 40.0\n')
    assert cli("jig", tmp_path / "target.toml", "--sensor", "nominal").code == 2
    assert "diameter_mm = 40.0" in cli("jig", tmp_path / "target.toml").out
    drawn = cli("jig", tmp_path / "target.toml", "--export", tmp_path / "ball.svg")
    assert drawn.code == 0, drawn.err


def test_the_numbers_as_json(cli: Cli, tmp_path: Path) -> None:
    jig = Jig.nominal()
    csv = _csv(tmp_path / "cmm.csv", jig.anchors, MACHINE @ jig.anchors_mm)
    told = cli("jig", "--anchors", csv, "--sensor", "nominal", "--json").json
    np.testing.assert_allclose([s["length_mm"] for s in told["strings"]], jig.lengths, rtol=0, atol=ATOL_MM)
    np.testing.assert_allclose([told["anchors_mm"][n] for n in jig.anchors], jig.anchors_mm, rtol=0, atol=ATOL_MM)
    assert told["measured"]
    assert told["less_drawn"]["rms_mm"] < ATOL_MM
    assert set(told["less_drawn"]["deviation_mm"]) == set(jig.anchors)
    assert told["seen_whole"] is True
    (tmp_path / "ball.toml").write_text('kind = "sphere"\ndiameter_mm = 40.0\n')
    assert cli("jig", tmp_path / "ball.toml", "--json").json == {"kind": "sphere", "diameter_mm": 40.0}
    assert cli("jig", "--json", "--toml").code == 2


def test_a_drawing_is_not_written_by_out(cli: Cli, tmp_path: Path) -> None:
    result = cli("jig", "--out", tmp_path / "jig.svg")
    assert result.code == 2
    assert "--export" in result.err
    assert not (tmp_path / "jig.svg").exists()
