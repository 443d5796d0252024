"""Ghosts: what the camera sees of light that has been scattered twice, drawn where it shows and as finely as it wants.

The scene is looked at through the pixels' own rays. A square of pixels whose corners show one surface and whose middle
is what its corners say is filled between them; others are halved, down to single pixels. Where two surfaces meet, the
smallest squares' light is that of the nearest known pixel of the same surface: a rim wants to know what each pixel
shows, not its light anew.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.config import EmulatorConfig, OpticsConfig
from perceptron_emu.image.deposit import convolved, gaussian_taps
from perceptron_emu.lens import Gather, gather, gathered, sharp_sigma_px
from perceptron_emu.light import BounceRoom, Cylinders, Sources, bounce_room, bounce_sources, far_lamp, radiance
from perceptron_emu.scene import Material, Scene
from perceptron_emu.solids import World, first_met, into_solids, normal_at, world_of

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]

COLUMNS = 40  # first squares in a row, a power of two wide; half as wide for narrow lobes, a quarter for mirrors
MARGIN_PX = 64  # squares reach beyond the image
BROAD, NARROW = 0.15, 0.05  # α of lobes so called
LAMP_LOBE = 0.1  # squares for room light's shadows are as fine as for such lobes
GLOSS_SEEN = 0.5  # part of the glossy reflectance that sends room light to the camera
FLAT = 0.03  # of the light there, by which a square's middle may differ from what its corners say
FAINT = 0.002  # of the brightest light among the first squares' corners: what is less is not refined
FAINT_E = 0.25  # electrons a pixel: squares with less at all corners and the middle are left; noise is 50 times as much
SIDES = ((0, 1, 0, 1), (0, 1, 0, 0), (0, 0, 0, 1), (1, 1, 0, 1), (0, 1, 1, 1))  # columns and rows of the two corners
# that a square's middle and its sides' middles lie between
KNOWN_PX = 4  # side of the squares within which a surface's light is taken over from where it is known
SAME_SURFACE = 0.9  # cosine between faces that go over into one another
PIXEL_VARIANCE = 1 / 12  # of a square pixel's own blur [px²]
BLUR_REACH = 4.0  # σ


class PixelRays(NamedTuple):
    """What a camera's pixels look along: x/z and y/z of their rays, and the electrons per radiance (H', W').

    One square more than the image to the right and below.
    """

    x: Float32
    y: Float32
    of_radiance: Float32


class GhostView(NamedTuple):
    """The camera in {P} for compiled code: rotation (3, 3), centre (3,) [mm], its pixels' rays."""

    R: Array
    t: Array
    rays: PixelRays


def ghost_electrons(
    scene: Scene, strings: Cylinders | None, thread: Material, config: EmulatorConfig
) -> Float32 | None:
    """Mean electrons of light scattered by two surfaces one after the other, free of speckle.

    Parameters
    ----------
    scene : Scene
        A sensor with a camera, and what stands before it.
    strings : Cylinders or None
        They send light on to solids; what is sent to them is left out.
    thread : Material
        Theirs.
    config : EmulatorConfig
        Laser and lens.

    Returns
    -------
    Float32 or None
        (H, W) [e⁻]; None where there is no such light.
    """
    sources = bounce_sources(scene, strings, thread, config)
    if sources is None:
        return None
    glossy = [m.roughness for m in (s.material for s in scene.solids) if m.specular > 0]
    side = first_side_px(scene.camera.width_px, min(glossy, default=1.0))
    return _light_of(sources, side, pixel_rays(scene.sensor, config.optics, config.laser.wavelength_nm), scene, config)


def lamp_electrons(scene: Scene, config: EmulatorConfig, of_white: Float32) -> Float32 | None:
    """Mean electrons of the room light that comes from its lamp, with the shadows that solids cast on solids.

    Parameters
    ----------
    scene : Scene
        A sensor with a camera, and solids.
    config : EmulatorConfig
        Its room light and lens.
    of_white : Float32
        Electrons (H, W) that a white surface facing the light brings.

    Returns
    -------
    Float32 or None
        (H, W) [e⁻]; None where nothing is lit.
    """
    if not scene.solids:
        return None
    matte = [Material(s.material.diffuse + GLOSS_SEEN * s.material.specular) for s in scene.solids]
    direction = np.array(config.ambient.direction) / np.linalg.norm(config.ambient.direction)
    sources = far_lamp(matte, direction, 1 - config.ambient.fill)
    rays = pixel_rays(scene.sensor, config.optics, config.laser.wavelength_nm)
    more = ((0, rays.x.shape[0] - of_white.shape[0]), (0, rays.x.shape[1] - of_white.shape[1]))
    rays = rays._replace(of_radiance=np.pad(np.float32(math.pi) * of_white, more, "edge"))
    return _light_of(sources, first_side_px(scene.camera.width_px, LAMP_LOBE), rays, scene, config)


def _light_of(sources: Sources, side: int, rays: PixelRays, scene: Scene, config: EmulatorConfig) -> Float32 | None:
    """The light of lamps (H, W) that solids send to the camera, blurred."""
    camera = scene.camera
    view = GhostView(np.array(camera.T_sensor_camera.R, order="C"), np.array(camera.centre_mm, dtype=float), rays)
    light = np.zeros(camera.shape, np.float32)
    shape = rays.x.shape
    canvas = GhostCanvas(np.zeros(shape, np.float32), np.zeros(shape, np.int32), np.zeros(shape, np.bool_))
    first, last = _draw(light, canvas, view, world_of(scene.solids), sources, side)
    if first > last:
        return None
    sigma = math.sqrt(sharp_sigma_px(config.optics, scene.sensor, config.laser.wavelength_nm) ** 2 + PIXEL_VARIANCE)
    taps = gaussian_taps(sigma, math.ceil(BLUR_REACH * sigma))
    _blur(light, taps, first, last)
    _as_beyond_the_border(light, taps)
    return light


def _as_beyond_the_border(light: Float32, taps: Float32) -> None:
    """Light blurred over the border is made up for, as if it went on outside."""
    reach = len(taps) // 2
    held = 1 / np.add.accumulate(taps)[reach : 2 * reach]  # of a pixel so many from the border
    light[:reach] *= held[:, None]
    light[-reach:] *= held[::-1, None]
    light[:, :reach] *= held
    light[:, -reach:] *= held[::-1]


def first_side_px(width_px: int, lobe: float) -> int:
    """Side of the first squares for a scene whose narrowest lobe has that α."""
    whole = 2 ** max(2, round(math.log2(width_px / COLUMNS)))
    return int(min(max(whole // (1 if lobe >= BROAD else 2 if lobe >= NARROW else 4), 2), MARGIN_PX))


@lru_cache(maxsize=4)
def pixel_rays(sensor: Sensor, optics: OpticsConfig, wavelength_nm: float) -> PixelRays:
    """The rays of a camera's pixels through its lens and chip.

    A pixel sees the solid angle J cos³α, J the Jacobian of its ray's (x/z, y/z), of a surface at any distance, and
    `gathered` says what of its radiance reaches the chip.
    """
    camera = sensor.require_camera()
    height, width = camera.height_px + MARGIN_PX + 1, camera.width_px + MARGIN_PX + 1
    u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    pixels = np.stack([u.ravel(), v.ravel()], -1)[:, None]
    undistorted = cv2.undistortPoints(pixels, camera.matrix, camera.distortion14)[:, 0]
    x, y = (np.asarray(undistorted[:, a], float).reshape(height, width) for a in range(2))
    jacobian = np.abs(np.gradient(x, axis=1) * np.gradient(y, axis=0) - np.gradient(x, axis=0) * np.gradient(y, axis=1))
    cosine = 1 / np.sqrt(1 + x * x + y * y)
    solid = np.empty(cosine.size)
    _gathered(gather(optics, sensor, wavelength_nm), cosine.ravel(), solid)
    of_radiance = jacobian * cosine * cosine * cosine * solid.reshape(cosine.shape)
    return PixelRays(*(a.astype(np.float32) for a in (x, y, of_radiance)))


@kernel
def _gathered(lens: Gather, cosine: Array, out: Array) -> None:
    """What of a radiance reaches the chip, times distance² (N,)."""
    for i in range(len(out)):
        out[i] = gathered(lens, cosine[i], 1.0)


class GhostCanvas(NamedTuple):
    """Electrons at pixels (H', W'), the face that each shows, counted from 1 (-1: nothing, 0: not yet asked), and
    whether its light was asked.
    """

    light: Float32
    face: NDArray[np.int32]
    known: NDArray[np.bool_]


class _Ghosts(NamedTuple):
    """What is drawn: the canvas, the camera, the solids and where the camera stands in their axes (S, 3), the lamps;
    room to work in, for `radiance` and for a way (3,) and an element (3, 3).
    """

    canvas: GhostCanvas
    camera: GhostView
    world: World
    eyes: Array
    sources: Sources
    room: BounceRoom
    way: Array
    element: Array


@kernel
def _draw(
    light: Float32, canvas: GhostCanvas, view: GhostView, world: World, sources: Sources, side: int
) -> tuple[int, int]:
    """Set the light (H, W) square by square; the first and the last row that have any."""
    height, width = light.shape
    eyes = np.empty((len(world.roots), 3))
    into_solids(world, view.t, eyes)
    room = bounce_room(sources, world)
    ghosts = _Ghosts(canvas, view, world, eyes, sources, room, np.empty(3), np.empty((3, 3)))
    most = np.float32(0)
    for j in range(0, height + side, side):
        for i in range(0, width + side, side):
            _ask(ghosts, j, i, np.float32(0))
            most = max(most, canvas.light[j, i])
    faint = max(np.float32(FAINT_E), np.float32(FAINT) * most)
    shares = np.empty(side, np.float32)
    todo = np.empty((64, 3), np.int64)
    first, last = height, -1
    for j in range(0, height, side):
        for i in range(0, width, side):
            todo[0, 0], todo[0, 1], todo[0, 2] = j, i, side
            left = 1
            while left > 0:
                left -= 1
                top, begin, n = todo[left]
                if top >= height or begin >= width:
                    continue
                if n == 1:
                    _ask(ghosts, top, begin, faint)
                    light[top, begin] = canvas.light[top, begin]
                    if light[top, begin] > 0:
                        first, last = min(first, top), max(last, top)
                    continue
                if _is_even(ghosts, faint, (top, begin, n), n == side):
                    if _fill(light, canvas.light, (top, begin, n), shares):
                        first, last = min(first, top), max(last, min(top + n, height) - 1)
                    continue
                half = n // 2
                for k in range(4):
                    todo[left, 0], todo[left, 1], todo[left, 2] = top + half * (k // 2), begin + half * (k % 2), half
                    left += 1
    return first, last


@kernel(inline=True)
def _is_even(ghosts: _Ghosts, faint: np.float32, square: tuple[int, int, int], is_first: bool) -> bool:
    """Whether a square's corners say what it shows; they are known afterwards.

    is_first: of the first squares the sides' middles are asked, too, and none is left because it is dark where two
    surfaces meet.
    """
    top, left, n = square
    canvas, most, off = ghosts.canvas, np.float32(0), np.float32(0)
    one_surface, within = True, faint if n < KNOWN_PX else np.float32(0)
    for k in range(9 if is_first else 5):
        if k == 5 and (most < faint or not one_surface):
            break
        j, i = _of_square(square, k)
        if canvas.face[j, i] == 0:
            _ask(ghosts, j, i, within)
        most = max(most, canvas.light[j, i])
        one_surface = one_surface and _one_surface(ghosts.world, canvas.face[top, left], canvas.face[j, i])
        if k > 3:
            before, after, above, below = SIDES[k - 4]
            mean = (
                canvas.light[top + n * above, left + n * before] + canvas.light[top + n * below, left + n * after]
            ) / np.float32(2)
            if k == 4:
                mean = (
                    mean + (canvas.light[top, left + n] + canvas.light[top + n, left]) / np.float32(2)
                ) / np.float32(2)
            off = max(off, abs(canvas.light[j, i] - mean))
    if one_surface:
        return bool(off <= max(faint, np.float32(FLAT) * most))
    return bool(most < faint and not is_first)


@kernel(inline=True)
def _of_square(square: tuple[int, int, int], k: int) -> tuple[int, int]:
    """Corner k of a square (top, left, side), its middle (4), or the middle of a side (5 to 8)."""
    top, left, n = square
    if k < 4:
        return top + n * (k // 2), left + n * (k % 2)
    before, after, above, below = SIDES[k - 4]
    return top + n * (above + below) // 2, left + n * (before + after) // 2


@kernel
def _one_surface(world: World, one: int, other: int) -> bool:
    """Whether two faces, counted from 1, are of one surface: neighbours in direction, on one solid."""
    if one == other:
        return True
    if one < 1 or other < 1:
        return False
    for k in range(len(world.first) - 1):
        if (one <= world.first[k + 1]) != (other <= world.first[k + 1]):
            return False
    cosine = 0.0
    for a in range(3):
        cosine += world.outwards[one - 1, a] * world.outwards[other - 1, a]
    return cosine > SAME_SURFACE


@kernel
def _ask(ghosts: _Ghosts, j: int, i: int, faint: np.float32) -> None:
    """What the pixel shows and its light, where they are not known yet.

    faint: above 0 light may be taken over from the pixels of the surface that are known within KNOWN_PX, where these
    differ by no more than that or FLAT.
    """
    canvas, view, world = ghosts.canvas, ghosts.camera, ghosts.world
    if canvas.face[j, i] != 0:
        return
    way, element = ghosts.way, ghosts.element
    x, y = float(view.rays.x[j, i]), float(view.rays.y[j, i])
    for a in range(3):
        way[a] = view.R[a, 0] * x + view.R[a, 1] * y + view.R[a, 2]
    hit = first_met(world, ghosts.eyes, way, ghosts.room.stack)
    canvas.face[j, i] = hit.triangle + 1 if hit.solid >= 0 else -1
    if hit.solid < 0 or (faint > 0 and _taken_over(canvas, world, j, i, faint)):
        return
    normal_at(world, hit, element[1])
    size = math.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    towards = 0.0
    for a in range(3):
        element[0, a] = view.t[a] + hit.distance * way[a]
        element[2, a] = -way[a] / size
        towards += element[1, a] * element[2, a]
    canvas.known[j, i] = True
    if towards < 0:
        if world.closed[hit.solid]:
            return
        for a in range(3):
            element[1, a] = -element[1, a]
    clear = hit.solid if world.bare[hit.triangle] else -1
    light = radiance(ghosts.sources, world, element, hit.solid, clear, ghosts.room)
    canvas.light[j, i] = light * view.rays.of_radiance[j, i]


@kernel(inline=True)
def _taken_over(canvas: GhostCanvas, world: World, j: int, i: int, faint: np.float32) -> bool:
    """Whether the light of a pixel is that of the nearest one of its surface in its square of KNOWN_PX; set if so."""
    top, left = j - j % KNOWN_PX, i - i % KNOWN_PX
    least, most, nearest, count = np.float32(np.inf), np.float32(0), np.float32(0), 0
    closest = 2 * KNOWN_PX * KNOWN_PX
    for k in range(5):
        at = _of_square((top, left, KNOWN_PX), k)
        if not (canvas.known[at] and _one_surface(world, canvas.face[j, i], canvas.face[at])):
            continue
        value, apart = canvas.light[at], (at[0] - j) ** 2 + (at[1] - i) ** 2
        least, most, count = min(least, value), max(most, value), count + 1
        if apart < closest:
            nearest, closest = value, apart
    if count < 2 or most - least > max(faint, np.float32(FLAT) * most):
        return False
    canvas.light[j, i] = nearest
    return True


@kernel
def _fill(light: Float32, known: Float32, square: tuple[int, int, int], shares: Float32) -> bool:
    """Fill a square between its corners, linearly; whether there is any light in it. shares: room for its side."""
    height, width = light.shape
    top, left, n = square
    a, b, c, d = known[top, left], known[top, left + n], known[top + n, left], known[top + n, left + n]
    if a <= 0 and b <= 0 and c <= 0 and d <= 0:
        return False
    for i in range(n):
        shares[i] = np.float32(i / n)
    columns = min(n, width - left)
    for j in range(top, min(top + n, height)):
        t = shares[j - top]
        before, after = a + t * (c - a), b + t * (d - b)
        row, step = light[j, left : left + columns], after - before
        for i in range(columns):
            row[i] = before + shares[i] * step
    return True


@kernel(fastmath=True)
def _blur(light: Float32, taps: Float32, first: int, last: int) -> None:
    """Blur rows first to last of the light (H, W), and those that it reaches, in place; nothing is outside."""
    reach = len(taps) // 2
    height, width = light.shape
    low, high = max(first - reach, 0), min(last + reach, height - 1)
    line = np.zeros(width + 2 * reach, np.float32)
    rows = np.zeros((last - first + 1, width), np.float32)
    for j in range(first, last + 1):
        for i in range(width):
            line[reach + i] = light[j, i]
        convolved(line, taps, rows[j - first])
    for j in range(low, high + 1):
        out = light[j]
        out[:] = 0
        for k in range(max(first, j - reach), min(last, j + reach) + 1):
            weight, row = taps[reach + k - j], rows[k - first]
            for i in range(width):
                out[i] += weight * row[i]
