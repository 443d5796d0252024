"""What calibrate says of files that look wrong, in its notes."""

from __future__ import annotations

from pathlib import Path

from tests.workbench.helpers import Cli, edit


def test_a_misspelt_location_is_named(cli: Cli, dataset: Path) -> None:
    """One frame at a place of its own: the answer stands, one note names frame and place."""
    lines = (dataset / "frames.csv").read_text().splitlines()
    cells = lines[2].split(",")
    cells[2] += cells[2]
    lines[2] = ",".join(cells)
    (dataset / "frames.csv").write_text("\n".join(lines) + "\n")
    done = cli("calibrate", dataset, "--json")
    assert done.code == 0
    naming = [note for note in done.json["notes"] if f'"{cells[2]}"' in note]
    assert len(naming) == 1, done.json["notes"]
    assert f"frame {cells[0]} alone" in naming[0]


def test_a_clean_dataset_has_no_remarks(cli: Cli, dataset: Path) -> None:
    """Nothing is said where nothing is wrong."""
    notes = cli("calibrate", dataset, "--json").json["notes"]
    assert not [note for note in notes if " alone" in note or "left out as" in note]


def test_the_jig_of_another_cell_is_suspected(cli: Cli, dataset: Path) -> None:
    """Frames that no pose explains: no answer, and the note says which files to look at."""
    edit(dataset / "jig.toml", "side_mm = 100.0", "side_mm = 60.0")
    done = cli("calibrate", dataset, "--json")
    assert done.code == 3
    assert "not_labelled; no pose of the jig explains them: check that jig.toml" in " ".join(done.json["notes"])


def test_no_frame_to_solve_with_is_said(cli: Cli, dataset: Path) -> None:
    """A dataset of verify frames alone."""
    text = (dataset / "frames.csv").read_text().replace(",calibrate,", ",verify,")
    (dataset / "frames.csv").write_text(text)
    done = cli("calibrate", dataset, "--json")
    assert done.code == 3
    assert "no frame has the role calibrate" in " ".join(done.json["notes"])


def test_images_of_a_wrong_kind_are_named_in_the_verdict(cli: Cli, dataset: Path) -> None:
    for path in (dataset / "images").glob("*.png"):
        path.write_bytes(b"\xff\xd8\xff\xe0" + b"0" * 100)
    done = cli("calibrate", dataset, "--json")
    assert done.code == 3
    assert done.json["verdict"]["code"] == "frames_contradict"
    assert "images unreadable: a JPEG, whose compression moves spots" in done.json["verdict"]["text"]


def test_sentences_of_like_words_are_told_once_whatever_their_figures() -> None:
    from workbench.cell.remarks import merged

    files = ["a.csv: 3 of 9 points are marks", "b.csv: 4 of 9 points are marks", "c.csv: broken", "d.csv: broken"]
    said = merged([*files, "no file 3"])
    assert said == (
        "a.csv: 3 of 9 points are marks; the like of 1 further files",
        "c.csv: broken; the same of 1 further files",
        "no file 3",
    )
