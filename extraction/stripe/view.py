"""An image made ready for stripes: laser-off subtracted, cut to its region, turned so that sections are columns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.image import clipping_level, grey_levels
from geometry import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
IntArray = NDArray[np.int32]


class Pixels(NamedTuple):
    """Grey levels with sections as columns (H, W), and which to leave out (H, W), or (0, 0) for none."""

    grey: NDArray[Any]
    left_out: Mask


_NO_MASK = np.zeros((0, 0), dtype=bool)


@dataclass(frozen=True, eq=False)
class StripeView:
    """The grey levels that the stripe is searched in.

    grey: (sections' length, sections), integer. left_out: pixels not to be used, of the same shape or (0, 0).
    clip_dn: grey level from which a pixel is clipped. black_dn: level without light.
    origin_px: (u, v) of the region's first pixel. turned: whether a section is an image row.
    """

    grey: NDArray[np.generic]
    left_out: Mask
    clip_dn: float
    black_dn: float
    origin_px: tuple[int, int]
    turned: bool

    @property
    def pixels(self) -> Pixels:
        """What the kernels take."""
        return Pixels(self.grey, self.left_out)

    def uv_px(self, section: Array | IntArray, along: Array) -> Array:
        """Image coordinates (N, 2) of places ``along`` sections."""
        out = np.empty((len(section), 2))
        out[:, 1 if self.turned else 0], out[:, 0 if self.turned else 1] = section, along
        out += self.origin_px
        return out

    def directions(self, across: Array, along: Array) -> Array:
        """Image directions (N, 2) of vectors with these components across and along the sections."""
        return np.column_stack((along, across) if self.turned else (across, along))

    @property
    def first_section(self) -> int:
        """Image column, or row, of section 0."""
        return self.origin_px[1 if self.turned else 0]


def stripe_view(
    image: NDArray[np.generic],
    config: StripeConfig,
    laser_off: NDArray[np.generic] | None,
    mask: Mask | None,
    clip_dn: float | None,
    black_dn: float,
) -> StripeView:
    """The view of ``image`` (H, W) uint8 or uint16 that the config asks for; InputError where the arrays do not fit."""
    whole = grey_levels(image)
    _check(whole, laser_off, mask)
    u0, v0, u1, v1 = _region(config, whole.shape)
    clip = clipping_level(whole[v0:v1, u0:u1], clip_dn)
    part = (slice(v0, v1), slice(u0, u1))
    grey: NDArray[Any] = whole[part]
    left_out = _NO_MASK if mask is None else ~mask[part]
    if laser_off is not None:
        bright = np.greater_equal(grey, clip)
        grey, black_dn = grey.astype(np.int32) - laser_off[part].astype(np.int32), 0.0
        grey[bright] = np.ceil(clip)  # a clipped core stays one plateau; less the other image it would be hollow
    elif grey.dtype != np.uint8:
        grey = grey.astype(np.int32)  # the kernels are compiled for two kinds of image, not for four
    turned = config.direction == "rows"
    return StripeView(_oriented(grey, turned), _oriented(left_out, turned), clip, black_dn, (u0, v0), turned)


def turn(view: StripeView) -> StripeView:
    """The same pixels with the other direction's sections as columns."""
    return replace(
        view, grey=_oriented(view.grey, True), left_out=_oriented(view.left_out, True), turned=not view.turned
    )


def _oriented(a: NDArray[Any], turned: bool) -> NDArray[Any]:
    if a.size == 0 or not turned:
        return np.ascontiguousarray(a)
    return cv2.transpose(np.ascontiguousarray(a)) if a.dtype != bool else np.ascontiguousarray(a.T)


def _check(image: NDArray[np.generic], laser_off: NDArray[np.generic] | None, mask: Mask | None) -> None:
    if laser_off is not None and (laser_off.shape != image.shape or laser_off.dtype != image.dtype):
        raise InputError(
            f"the laser-off image is {laser_off.dtype} {laser_off.shape}: it must be like the image, "
            f"{image.dtype} {image.shape}"
        )
    if mask is not None and (mask.shape != image.shape or mask.dtype != np.bool_):
        raise InputError(
            f"the mask is {mask.dtype} {mask.shape}: it must be boolean and as large as the image {image.shape}"
        )


def _region(config: StripeConfig, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    if config.region_px is None:
        return 0, 0, shape[1], shape[0]
    u0, v0, u1, v1 = config.region_px
    if not (0 <= u0 < u1 <= shape[1] and 0 <= v0 < v1 <= shape[0]):
        raise InputError(
            f"region_px = {list(config.region_px)} (u0, v0, u1, v1) must lie in the image of {shape[1]} × {shape[0]} px"
        )
    return u0, v0, u1, v1
