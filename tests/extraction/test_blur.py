"""The compiled blur against OpenCV's with the same kernel, and what it says of the blocks against numpy."""

import cv2
import numpy as np
import pytest

from extraction.spots.detect.blur import BLOCK_PX, blur

RTOL = 1e-6  # of the largest grey level: single precision


@pytest.mark.parametrize("sigma", [0.5, 1.3, 1.6, 4.0])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("size", [(61, 83), (32, 48), (5, 9), (3, 40), (1, 1)])
def test_blur_is_that_of_opencv_and_its_survey_true(sigma, kind, size):
    most = np.iinfo(kind).max
    image = np.random.default_rng(1).integers(0, most + 1, size).astype(kind)
    seen = blur(image, sigma)
    expected = cv2.sepFilter2D(image, cv2.CV_64F, seen.kernel, seen.kernel, borderType=cv2.BORDER_REFLECT_101)
    np.testing.assert_allclose(seen.smooth, expected, atol=RTOL * most)
    ideal = cv2.getGaussianKernel(len(seen.kernel), sigma, cv2.CV_64F)[:, 0]
    np.testing.assert_allclose(seen.kernel, ideal, atol=1.01 / 256)  # rounded to whole weights
    assert seen.kernel.sum() == pytest.approx(1.0, abs=1e-12)
    h, w = seen.mean.shape
    assert (h, w) == (max(1, size[0] // BLOCK_PX), max(1, size[1] // BLOCK_PX))
    for j in range(h):
        rows = slice(j * BLOCK_PX, None if j == h - 1 else (j + 1) * BLOCK_PX)
        for i in range(w):
            block = seen.smooth[rows, i * BLOCK_PX : None if i == w - 1 else (i + 1) * BLOCK_PX]
            assert seen.tops[j, i] == block.max()
            part = block[::4].astype(float)
            assert seen.mean[j, i] == pytest.approx(part.mean(), rel=1e-5)
            assert seen.variance[j, i] == pytest.approx(part.var(), rel=1e-4, abs=1e-9 * most**2)


def test_a_view_that_is_not_contiguous_is_blurred_as_its_copy():
    image = np.random.default_rng(2).integers(0, 256, (64, 96)).astype(np.uint8)
    np.testing.assert_array_equal(blur(image[:, ::2], 1.3).smooth, blur(image[:, ::2].copy(), 1.3).smooth)
