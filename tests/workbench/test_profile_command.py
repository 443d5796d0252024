"""`profile`: one image and folders, with a sensor and without, overlays, JSON, colour; exit codes and sentences."""

import json

import cv2
import numpy as np
import pytest

from extraction.stripe.pictures import draw
from workbench.cell.stripes import is_mosaic


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three pictures and one file that is none of them."""
    path = tmp_path_factory.mktemp("stripes")
    for name, kind in (("a.png", "beside_a_border"), ("b.bmp", "white_core"), ("c.png", "texture")):
        cv2.imwrite(str(path / name), draw(kind, np.random.default_rng(1)).image)
    (path / "broken.png").write_bytes(b"no picture")
    return path


def test_a_folder_without_a_sensor_gives_pixels(cli, folder, tmp_path):
    done = cli("profile", folder, "--csv", tmp_path / "csv", "--overlay", tmp_path / "seen", "--json")
    assert done.code == 0, done.err
    images = {image["image"].rsplit("/", 1)[-1]: image for image in json.loads(done.out)["images"]}
    assert list(images) == ["a.png", "b.bmp", "c.png"]
    assert "broken.png" in done.err
    assert images["a.png"]["n_points"] == 640
    assert images["a.png"]["direction"] == "columns"
    assert images["b.bmp"]["flags"] == {"saturated": 640}
    assert images["c.png"]["n_points"] == 0
    assert images["c.png"]["reason"].startswith("no stripe")
    lines = (tmp_path / "csv" / "a.csv").read_text().splitlines()
    assert lines[0] == "section,u_px,v_px,sigma_px,flag"
    assert len(lines) == 641
    seen = cv2.imread(str(tmp_path / "seen" / "a.png"))
    assert np.count_nonzero(np.all(seen == (0, 255, 0), axis=2)) > 640


def test_colour_takes_the_channel_that_is_asked(cli, tmp_path):
    picture = draw("colour", np.random.default_rng(2))
    path = tmp_path / "colour.png"
    cv2.imwrite(str(path), picture.image)
    clipped = cli("profile", path, "--json")
    blue = cli("profile", path, "--channel", "blue", "--json")
    assert "is a colour image" in clipped.err
    for done, flagged in ((clipped, 640), (blue, 0)):
        image = json.loads(done.out)["images"][0]
        assert image["n_flagged"] == flagged
        off = [p["v_px"] - picture.truth[p["section"]] for p in image["points"]]
        assert np.abs(off).max() < 0.5


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (("nowhere.png", "--json"), 2, "nowhere.png"),
        (("FOLDER/a.png",), 2, "--json"),
        (("FOLDER/a.png", "--ply", "x.ply"), 2, "--sensor"),
        (("FOLDER/c.png", "--json"), 3, "no stripe"),
        (("EMPTY", "--json"), 2, "holds no image"),
    ],
)
def test_what_can_not_be_done_is_one_sentence(cli, folder, tmp_path, arguments, code, says):
    arguments = [str(a).replace("FOLDER", str(folder)).replace("EMPTY", str(tmp_path)) for a in arguments]
    done = cli("profile", *arguments)
    assert done.code == code
    assert says in done.err


def test_a_mosaic_is_known_from_a_stripe():
    picture = draw("beside_a_border", np.random.default_rng(3)).image
    raw = picture.copy()
    raw[0::2, 1::2] //= 4
    raw[1::2, 0::2] //= 4
    raw[1::2, 1::2] //= 6
    assert is_mosaic(raw)
    assert not is_mosaic(picture)
    assert not is_mosaic(np.ascontiguousarray(picture.T))
