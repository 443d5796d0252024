"""`profile`: one image and folders, with a sensor and without, overlays, JSON, colour; exit codes and sentences."""

import json

import cv2
import numpy as np
import pytest

from calib.synthetic.cell import default_sensor
from extraction.stripe.pictures import draw
from perceptron_emu import EmulatorConfig
from workbench.cell.stripes import is_mosaic
from workbench.files import read_sensor, sensor_text


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
    whole = {"piece": 0, "first_section": 0, "last_section": 639, "begin_px": None, "end_px": None}
    assert images["a.png"]["ends"] == [{**whole, "sigma_begin_px": None, "sigma_end_px": None}]
    assert images["c.png"]["ends"] == []
    assert images["b.bmp"]["flags"] == {"saturated": 640}
    assert images["c.png"]["n_points"] == 0
    assert images["c.png"]["reason"].startswith("no stripe")
    lines = (tmp_path / "csv" / "a.csv").read_text().splitlines()
    assert lines[0] == "section,u_px,v_px,sigma_px,flag"
    assert len(lines) == 641
    seen = cv2.imread(str(tmp_path / "seen" / "a.png"))
    assert np.count_nonzero(np.all(seen == (0, 255, 0), axis=2)) > 640


def test_a_sensor_that_knows_its_uncertainty_tells_it_beside_the_random_part(cli, folder, tmp_path):
    image, exact, sensor = folder / "a.png", tmp_path / "exact.toml", tmp_path / "sensor.toml"
    height, width = cv2.imread(str(image), cv2.IMREAD_GRAYSCALE).shape
    small = default_sensor().with_camera(width_px=width, height_px=height, cx_px=width / 2, cy_px=height / 2)
    exact.write_text(sensor_text(small, EmulatorConfig()))
    sensor.write_text(exact.read_text() + "[uncertainty]\nplane_shift_mm = 0.1\n")
    done = cli("profile", image, "--sensor", sensor, "--csv", tmp_path / "p.csv", "--json")
    assert done.code == 0, done.err
    points = json.loads(done.out)["images"][0]["points"]
    camera = read_sensor(sensor).require_camera()
    for point in points[:: len(points) // 7]:  # along the camera's ray, the plane shifted by 0.1 mm
        slope = (np.array([point["y_mm"], point["z_mm"]]) - camera.centre_mm[1:]) / -camera.centre_mm[0]
        own = [point["sigma_sensor_y_mm"], point["sigma_sensor_z_mm"]]
        np.testing.assert_allclose(own, np.abs(0.1 * slope), rtol=1e-3, atol=1e-6)
    plain = cli("profile", image, "--sensor", exact, "--csv", tmp_path / "q.csv", "--json")
    assert "sigma_sensor_y_mm" not in plain.out
    header, known = ((tmp_path / name).read_text().splitlines()[0] for name in ("q.csv", "p.csv"))
    assert known == header + ",sigma_sensor_y_mm,sigma_sensor_z_mm,cov_sensor_yz_mm2"
    again = cli("profile", tmp_path / "q.csv", "--sensor", sensor, "--csv", tmp_path / "r.csv")
    assert again.code == 0, again.err
    assert (tmp_path / "r.csv").read_text().splitlines()[0] == known


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
