"""Our region moments against scikit-image's region shapes."""

import numpy as np

from extraction import extract_stages, region_shapes
from tests.extraction.spots import camera, make_sensor, mean_frame, some_spots


def test_regions_are_those_that_scikit_image_measures():
    rng = np.random.default_rng(1)
    stages = extract_stages(camera(mean_frame(some_spots(rng)), rng), make_sensor())
    shapes = region_shapes(stages)
    k = shapes["candidate"]
    np.testing.assert_array_equal(shapes["area_px"], stages.candidates.area_px[k])
    # ours are weighted by the light above the level: the centres agree to a fraction of a pixel
    centre = np.column_stack([shapes["u_px"], shapes["v_px"]])
    np.testing.assert_allclose(stages.candidates.mean_uv_px[k], centre, atol=0.5)
    long = np.linalg.eigvalsh(stages.candidates.cov_uv_px2[k])[:, 1]
    assert np.corrcoef(np.sqrt(long), shapes["length_px"])[0, 1] > 0.9
    # twisted by no more than the weights do: of regions that are no disc
    uu, uv, vv = (stages.candidates.cov_uv_px2[k][:, a, b] for a, b in ((0, 0), (0, 1), (1, 1)))
    turn = np.mod(0.5 * np.arctan2(2 * uv, uu - vv) - shapes["axis_rad"] + np.pi / 2, np.pi) - np.pi / 2
    assert np.median(np.abs(turn[shapes["eccentricity"] > 0.8])) < 0.1
    assert np.all((shapes["axis_rad"] > -np.pi / 2) & (shapes["axis_rad"] <= np.pi / 2))
    assert set(shapes["reason"]) <= set(stages.candidates.reason)
