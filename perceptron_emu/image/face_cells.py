"""Flat faces drawn straight into the lens's image: which of its cells each face reaches, and the nearest one's level.

The image is cut into cells. In each the lens is taken for an affine map from pixels to the pinhole image, in which a
face's edges are straight: no picture without the lens is drawn in between.
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

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]
Index = NDArray[np.int64]

CELL_PX = 32  # side of the cells: a lens that bows a line of 1000 px by 6 is affine in them to 0.01 px
MAX_VIEW = 4.0  # image sizes: farther out a lens's distortion shows nothing
CHUNK = 512  # values that are blurred at a time: what the fastest cache holds
FLAT_PX2 = 1e-9  # twice the area of a face's image below which it is not drawn
FOLDED = 1e-6  # of the pinhole image's scale: a lens that squeezes a cell so much shows nothing in it


class PixelCells(NamedTuple):
    """Where a lens's pixels look, cell by cell; a cell's own pixels begin at (0, 0), those that the blur mixes into it
    at (−reach, −reach).

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the image.
    plane : Array
        (h, w, 2, 3) the affine map from a cell's pixels (1, column, row) to pinhole coordinates x, y [px from the
        principal point].
    pixel : Array
        (h, w, 2, 3) from (1, x, y) to a cell's column and row.
    corner : Array
        (2, h, w) pinhole coordinates of each cell's first pixel, mixed ones included.
    boxes : Array
        (h, w, 4) least and largest x, least and largest y of each cell, mixed pixels included.
    columns, rows : Array
        Least and largest x of all cells of a column (w, 2), y of a row (h, 2).
    reach : int
        Of the blur [px].
    """

    shape: tuple[int, int]
    plane: Array
    pixel: Array
    corner: Array
    boxes: Array
    columns: Array
    rows: Array
    reach: int


@lru_cache(maxsize=8)
def pixel_cells(sensor: Sensor, reach_px: int) -> PixelCells:
    """The cells of a sensor's image.

    Parameters
    ----------
    sensor : Sensor
        With a camera.
    reach_px : int
        How far the blur mixes pixels.

    Returns
    -------
    PixelCells
        For `faces_in_cells` and `draw_cells`.
    """
    camera = sensor.require_camera()
    h, w = -(-camera.height_px // CELL_PX), -(-camera.width_px // CELL_PX)
    side = CELL_PX - 1 + 2 * reach_px
    first = np.stack(np.meshgrid(np.arange(w), np.arange(h)), -1) * CELL_PX - reach_px  # (h, w, 2) u, v
    corners: Array = (first[:, :, None] + side * np.array([[0, 0], [1, 0], [0, 1], [1, 1]])).astype(float)
    seen = corners.reshape(-1, 2)
    if any(camera.distortion):
        matrix = camera.matrix
        seen = np.asarray(cv2.undistortPoints(seen[:, None], matrix, camera.distortion14, P=matrix)[:, 0], float)
    largest = MAX_VIEW * max(camera.width_px, camera.height_px)
    seen = np.clip(np.nan_to_num(seen, nan=-largest), -largest, largest) - [camera.cx_px, camera.cy_px]
    a, b, c, d = np.moveaxis(seen.reshape(h, w, 4, 2), 2, 0)
    plane = np.empty((h, w, 2, 3))
    plane[..., 1], plane[..., 2] = ((b + d) - (a + c)) / (2 * side), ((c + d) - (a + b)) / (2 * side)
    plane[..., 0] = ((a + d) + (b + c)) / 4 - (plane[..., 1] + plane[..., 2]) * ((CELL_PX - 1) / 2)
    (_, xi, xj), (_, yi, yj) = np.moveaxis(plane[..., 0, :], -1, 0), np.moveaxis(plane[..., 1, :], -1, 0)
    det = xi * yj - xj * yi
    shows = np.abs(det) > FOLDED
    det = np.where(shows, det, 1.0)
    pixel = np.empty((h, w, 2, 3))
    pixel[..., 0, 1], pixel[..., 0, 2] = yj / det, -xj / det
    pixel[..., 1, 1], pixel[..., 1, 2] = -yi / det, xi / det
    pixel[..., 0] = -(pixel[..., 1] * plane[..., :1, 0] + pixel[..., 2] * plane[..., 1:, 0])
    corner = _corners(plane, reach_px)
    boxes = np.stack([f(values, 0) for values in corner for f in (np.min, np.max)], -1)
    boxes[~shows] = np.nan
    columns = np.stack([np.nanmin(boxes[..., 0], 0), np.nanmax(boxes[..., 1], 0)], -1)
    rows = np.stack([np.nanmin(boxes[..., 2], 1), np.nanmax(boxes[..., 3], 1)], -1)
    return PixelCells(camera.shape, plane, pixel, np.ascontiguousarray(corner[:, 0]), boxes, columns, rows, reach_px)


def _corners(plane: Array, reach: int) -> Array:
    """Pinhole coordinates (2, 4, h, w) of the cells' outermost pixels."""
    ends = np.array([-float(reach), CELL_PX - 1.0 + reach])
    at = np.array([[1, i, j] for j in ends for i in ends])
    return np.asarray(np.einsum("hwak,ck->achw", plane, at))


class FaceEdges(NamedTuple):
    """Images of flat faces (F,) in pinhole coordinates [px from the principal point].

    Parameters
    ----------
    begin : NDArray
        (F + 1,) where each face's edges begin.
    edges : Array
        (E, 4) x, y of the upper end and of the lower one.
    inverse : Array
        (F, 3) the inverse depth [1/mm], i·x + j·y + k.
    bounds : Array
        (F, 5) least and largest x, least and largest y, largest inverse depth.
    level : Float32
        (F,).
    """

    begin: Index
    edges: Array
    inverse: Array
    bounds: Array
    level: Float32


class Outlines(NamedTuple):
    """Flat faces (F,) by their edges.

    Parameters
    ----------
    begin : NDArray
        (F + 1,) where each face's edges begin.
    ends : Array
        (E, 2, 3) [mm] in the camera's axes, all before it.
    normal : Array
        (F, 3).
    level : Float32
        (F,).
    """

    begin: Index
    ends: Array
    normal: Array
    level: Float32


@kernel
def face_edges(faces: Outlines, focal: tuple[float, float]) -> FaceEdges:
    """The images of faces before a camera of so long a focal length along x and y [px]."""
    begin, ends = faces.begin, faces.ends
    edges, count = np.empty((len(ends), 4)), len(faces.level)
    inverse, bounds = np.empty((count, 3)), np.empty((count, 5))
    for f in range(count):
        left, right, top, bottom, near = np.inf, -np.inf, np.inf, -np.inf, 0.0
        for e in range(begin[f], begin[f + 1]):
            w0, w1 = 1 / ends[e, 0, 2], 1 / ends[e, 1, 2]
            x0, y0 = focal[0] * ends[e, 0, 0] * w0, focal[1] * ends[e, 0, 1] * w0
            x1, y1 = focal[0] * ends[e, 1, 0] * w1, focal[1] * ends[e, 1, 1] * w1
            left, right = min(left, x0, x1), max(right, x0, x1)
            top, bottom, near = min(top, y0, y1), max(bottom, y0, y1), max(near, w0, w1)
            if y0 > y1 or (y0 == y1 and x0 > x1):  # one order, whichever face the edge is of
                x0, y0, x1, y1 = x1, y1, x0, y0
            edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3] = x0, y0, x1, y1
        # n·p = n·c on the plane, and p = (x/fx, y/fy, 1)/w
        normal, at = faces.normal[f], ends[begin[f], 0]
        offset = normal[0] * at[0] + normal[1] * at[1] + normal[2] * at[2]
        if abs(offset) < FLAT_PX2:  # seen edge on
            left, right = np.inf, -np.inf
            offset = 1.0
        inverse[f, 0], inverse[f, 1] = normal[0] / (focal[0] * offset), normal[1] / (focal[1] * offset)
        inverse[f, 2] = normal[2] / offset
        bounds[f, 0], bounds[f, 1], bounds[f, 2], bounds[f, 3], bounds[f, 4] = left, right, top, bottom, near
    return FaceEdges(begin, edges, inverse, bounds, faces.level)


class CellFaces(NamedTuple):
    """Which faces each cell shows something of.

    Parameters
    ----------
    begin : NDArray
        (cells + 1,) where each cell's begin.
    face : NDArray
        (N,) their numbers, in order.
    corner : NDArray
        (N,) whether the face holds the cell's first pixel, mixed ones included.
    whole : NDArray
        (N,) whether it holds all of the cell.
    """

    begin: Index
    face: NDArray[np.int32]
    corner: NDArray[np.bool_]
    whole: NDArray[np.bool_]


@kernel
def faces_in_cells(cells: PixelCells, faces: FaceEdges) -> CellFaces:
    """The faces of each cell, without those that lie behind one that covers it."""
    h, w = cells.boxes.shape[:2]
    cell, face, near = np.empty(4096, np.int64), np.empty(4096, np.int32), np.empty(4096)
    corner, whole = np.empty(4096, np.bool_), np.empty(4096, np.bool_)
    nearest, count = np.zeros((h, w)), np.zeros(h * w + 1, np.int64)
    inside, cut = np.empty((h, w), np.bool_), np.empty((h, w), np.bool_)
    n = 0
    for f in range(len(faces.bounds)):
        bounds = faces.bounds[f]
        top, bottom = _range(cells.rows, bounds[2], bounds[3])
        left, right = _range(cells.columns, bounds[0], bounds[1])
        if top >= bottom or left >= right:
            continue
        inside[top:bottom, left:right] = False
        cut[top:bottom, left:right] = False
        for e in range(faces.begin[f], faces.begin[f + 1]):
            _count_edge(cells, faces.edges[e], (top, bottom, left, right), inside, cut)
        while n + (bottom - top) * (right - left) > len(cell):
            cell, face, near = np.concatenate((cell, cell)), np.concatenate((face, face)), np.concatenate((near, near))
            corner, whole = np.concatenate((corner, corner)), np.concatenate((whole, whole))
        for b in range(top, bottom):
            for a in range(left, right):
                if not (inside[b, a] or cut[b, a]) or math.isnan(cells.boxes[b, a, 0]):
                    continue
                low, high = _depths(faces.inverse[f], cells.boxes[b, a])
                cell[n], face[n], near[n] = b * w + a, f, min(high, bounds[4])
                corner[n], whole[n] = inside[b, a], not cut[b, a]
                if whole[n]:
                    nearest[b, a] = max(nearest[b, a], low)
                n += 1
    flat = nearest.ravel()
    for k in range(n):
        count[cell[k] + 1] += near[k] >= flat[cell[k]]
    for c in range(h * w):
        count[c + 1] += count[c]
    begin, m = count.copy(), count[-1]
    of, holds, covers = np.empty(m, np.int32), np.empty(m, np.bool_), np.empty(m, np.bool_)
    for k in range(n):
        if near[k] >= flat[cell[k]]:
            place = count[cell[k]]
            of[place], holds[place], covers[place] = face[k], corner[k], whole[k]
            count[cell[k]] += 1
    return CellFaces(begin, of, holds, covers)


@kernel
def _range(spans: Array, low: float, high: float) -> tuple[int, int]:
    """First of the spans (n, 2) that meets low … high, and the one after the last."""
    first, last = 0, len(spans)
    while first < last and not (spans[first, 1] >= low and spans[first, 0] <= high):
        first += 1
    while last > first and not (spans[last - 1, 1] >= low and spans[last - 1, 0] <= high):
        last -= 1
    return first, last


@kernel
def _count_edge(
    cells: PixelCells,
    edge: Array,
    part: tuple[int, int, int, int],
    inside: NDArray[np.bool_],
    cut: NDArray[np.bool_],
) -> None:
    """Turn ``inside`` over for cells whose first pixel lies to the right of an edge, mark those that it cuts."""
    x0, y0, x1, y1 = edge
    top, bottom, left, right = part
    (across, down), boxes = cells.corner, cells.boxes
    slope = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
    low, high = min(x0, x1), max(x0, x1)
    nx, ny = y1 - y0, x0 - x1
    at = nx * x0 + ny * y0
    while left < right and cells.columns[left, 1] < low:
        left += 1
    last = left
    while last < right and cells.columns[last, 0] <= high:
        last += 1
    for b in range(top, bottom):
        if cells.rows[b, 1] < y0 or cells.rows[b, 0] > y1:
            continue
        for a in range(left, right):
            y = down[b, a]
            inside[b, a] ^= ((y0 <= y) != (y1 <= y)) & (x0 + (y - y0) * slope < across[b, a])
        for a in range(left, last):
            x_low, x_high, y_low, y_high = boxes[b, a, 0], boxes[b, a, 1], boxes[b, a, 2], boxes[b, a, 3]
            if x_high < low or x_low > high or y_high < y0 or y_low > y1:
                continue
            # the line's height is least in one corner of the box, largest in the opposite one
            lowest = nx * x_low + (ny * y_low if ny > 0 else ny * y_high)
            highest = nx * x_high + (ny * y_high if ny > 0 else ny * y_low)
            if lowest <= at <= highest:
                cut[b, a] = True


@kernel
def _depths(inverse: Array, box: Array) -> tuple[float, float]:
    """Least and largest inverse depth of a face's plane in a box."""
    across, down = (inverse[0] * box[0], inverse[0] * box[1]), (inverse[1] * box[2], inverse[1] * box[3])
    return inverse[2] + min(across) + min(down), inverse[2] + max(across) + max(down)


class CellRoom(NamedTuple):
    """Room to draw cells in: depths and levels of a run of cells, row after row; where a cell's rows are crossed, how
    often, and the rows from which on its left border is in a face if it was not, and the other way about.
    """

    depth: Float32
    level: Float32
    crossings: NDArray[np.int64]
    crossed: NDArray[np.int64]
    turned: NDArray[np.bool_]


@kernel
def draw_cells(
    cells: PixelCells, faces: FaceEdges, lists: CellFaces, taps: Float32, scale: Float32, out: Float32
) -> None:
    """Set out (H, W), of 0 so far, to scale times the level of the nearest face, blurred by the taps along each axis.

    Cells of a row that touch and show several levels are drawn in one run.
    """
    height, width = out.shape
    h, w = cells.boxes.shape[:2]
    reach, most = cells.reach, 0
    rows = CELL_PX + 2 * reach
    for f in range(len(faces.begin) - 1):
        most = max(most, faces.begin[f + 1] - faces.begin[f])
    size = rows * w * (CELL_PX + 2 * reach)
    # each by itself: parts of one array run four times slower here, read and written beside one another
    depth, sharp, blurred = np.empty(size, np.float32), np.empty(size, np.float32), np.empty(size, np.float32)
    crossings, turned = np.empty((rows, most + 2), np.int64), np.zeros(rows, np.bool_)
    room = CellRoom(depth, sharp, crossings, np.empty(rows, np.int64), turned)
    several, shown, runs = np.empty(w, np.bool_), np.empty(w, np.float32), np.empty((w, 3), np.int64)
    for b in range(h):
        top, bottom = b * CELL_PX, min((b + 1) * CELL_PX, height)
        for a in range(w):
            several[a], shown[a] = _level_of(lists, faces.level, b * w + a)
        _fill(shown, several, scale[top:bottom], out[top:bottom])
        count, n = _runs(several, reach, runs)
        if count == 0:
            continue
        depth[: rows * n] = 0
        sharp[: rows * n] = 0
        for r in range(count):
            _draw_run(cells, faces, lists, room, (b, runs[r, 0], runs[r, 1]), (runs[r, 2], n))
        # row after row in one line: a step of n blurs across, a step of 1 along
        _blurred(sharp[: rows * n], taps, n, blurred[: CELL_PX * n])
        _blurred(blurred[: CELL_PX * n], taps, 1, sharp[: CELL_PX * n - 2 * reach])
        for r in range(count):
            left, right, at = runs[r, 0] * CELL_PX, min(runs[r, 1] * CELL_PX, width), runs[r, 2]
            for j in range(top, bottom):
                _product(sharp[at : at + right - left], scale[j, left:right], out[j, left:right])
                at += n


@kernel
def _runs(several: NDArray[np.bool_], reach: int, runs: Index) -> tuple[int, int]:
    """Runs of cells that touch: first cell, the one after the last, the column where they and what is mixed in begin;
    how many runs and columns there are.
    """
    count, columns, a = 0, 0, 0
    while a < len(several):
        if not several[a]:
            a += 1
            continue
        first = a
        while a < len(several) and several[a]:
            a += 1
        runs[count, 0], runs[count, 1], runs[count, 2] = first, a, columns
        columns += (a - first) * CELL_PX + 2 * reach
        count += 1
    return count, columns


@kernel(fastmath=True)
def _blurred(line: Float32, taps: Float32, step: int, out: Float32) -> None:
    """Fill out (n,) with sums of the line's values so many steps apart, weighted by the taps."""
    reach = len(taps) // 2
    for first in range(0, len(out), CHUNK):
        here = out[first : first + CHUNK]
        n = len(here)
        begin = first + reach * step
        middle, weight = line[begin : begin + n], taps[reach]
        for i in range(n):
            here[i] = weight * middle[i]
        for k in range(reach):
            begin, end = first + k * step, first + (2 * reach - k) * step
            weight, before, after = taps[k], line[begin : begin + n], line[end : end + n]
            for i in range(n):
                here[i] += weight * (before[i] + after[i])


@kernel
def _level_of(lists: CellFaces, level: Float32, cell: int) -> tuple[bool, np.float32]:
    """Whether a cell shows several levels, else the one that it shows."""
    begin, end = lists.begin[cell], lists.begin[cell + 1]
    if begin == end:
        return False, np.float32(0)
    first, covered = level[lists.face[begin]], False
    for k in range(begin, end):
        if level[lists.face[k]] != first:
            return True, np.float32(0)
        covered |= lists.whole[k]
    return not covered, first


@kernel
def _fill(level: Float32, several: NDArray[np.bool_], scale: Float32, out: Float32) -> None:
    """Set rows of cells, of 0 so far, to scale times the level of each that shows one."""
    a, width = 0, out.shape[1]
    while a < len(level):
        first, value = a, level[a]
        while a < len(level) and level[a] == value and not several[a]:
            a += 1
        a = max(a, first + 1)
        if several[first] or value == 0:
            continue
        left, right = first * CELL_PX, min(a * CELL_PX, width)
        for j in range(len(out)):
            _multiple(value, scale[j, left:right], out[j, left:right])


@kernel(fastmath=True)
def _multiple(value: np.float32, scale: Float32, out: Float32) -> None:
    for i in range(len(out)):
        out[i] = value * scale[i]


@kernel(fastmath=True)
def _product(line: Float32, scale: Float32, out: Float32) -> None:
    for i in range(len(out)):
        out[i] = line[i] * scale[i]


@kernel
def _draw_run(
    cells: PixelCells,
    faces: FaceEdges,
    lists: CellFaces,
    room: CellRoom,
    run: tuple[int, int, int],
    to: tuple[int, int],
) -> None:
    """The levels of a run of cells: of row b, from one to another, with what the blur mixes into them.

    to: the column of the room where they begin, of so many.
    """
    (b, first, last), (begin_at, n) = run, to
    reach, w = cells.reach, cells.boxes.shape[1]
    rows = CELL_PX + 2 * reach
    depth, shown, crossings, count = room.depth, room.level, room.crossings, room.crossed
    for a in range(first, last):
        # the pixels beside a cell are its neighbour's where that is of the run
        low = -reach if a == first else 0
        high = CELL_PX + reach if a == last - 1 else CELL_PX
        at = begin_at + (a - first) * CELL_PX + reach
        plane = cells.plane[b, a]
        for k in range(lists.begin[b * w + a], lists.begin[b * w + a + 1]):
            f = lists.face[k]
            inverse, level = faces.inverse[f], faces.level[f]
            di = np.float32(inverse[0] * plane[0, 1] + inverse[1] * plane[1, 1])
            dj = inverse[0] * plane[0, 2] + inverse[1] * plane[1, 2]
            origin = inverse[0] * plane[0, 0] + inverse[1] * plane[1, 0] + inverse[2]
            if lists.whole[k]:
                for j in range(rows):
                    here = np.float32(origin + (j - reach) * dj)
                    span = j * n + at + low, high - low
                    _nearer(depth, shown, span, (here + np.float32(low) * di, di), level)
                continue
            top, bottom = _crossings(cells, faces, room, (b, a), f, lists.corner[k])
            for j in range(top, bottom):
                here = np.float32(origin + (j - reach) * dj)
                for c in range(0, count[j], 2):
                    end = min(crossings[j, c + 1], high) if c + 1 < count[j] else high
                    begin = max(crossings[j, c], low)
                    span = j * n + at + begin, end - begin
                    _nearer(depth, shown, span, (here + np.float32(begin) * di, di), level)


@kernel(inline=True)
def _nearer(
    depth: Float32, shown: Float32, span: tuple[int, int], inverse: tuple[np.float32, np.float32], level: np.float32
) -> None:
    """Draw a span (first place, length) where it is nearer than what is there.

    inverse: its inverse depth in the first place, and how much more it is in the next.
    """
    for i in range(max(span[1], 0)):
        value, at = inverse[0] + np.float32(i) * inverse[1], span[0] + i
        nearer = value > depth[at]
        depth[at] = value if nearer else depth[at]
        shown[at] = level if nearer else shown[at]


@kernel
def _crossings(
    cells: PixelCells, faces: FaceEdges, room: CellRoom, at: tuple[int, int], f: int, corner: bool
) -> tuple[int, int]:
    """Where the rows of a cell enter and leave a face, from −reach on, in order; first row with any and the one after
    the last. corner: whether the face holds the cell's first pixel.
    """
    b, a = at
    m, box, reach = cells.pixel[b, a], cells.boxes[b, a], cells.reach
    rows, limit = CELL_PX + 2 * reach, CELL_PX + reach
    left = -float(reach)
    count, places, turned = room.crossed, room.crossings, room.turned
    for j in range(rows):
        count[j] = 0
    first, last = (0, rows) if corner else (rows, 0)
    for e in range(faces.begin[f], faces.begin[f + 1]):
        x0, y0, x1, y1 = faces.edges[e]
        if box[3] < y0 or box[2] > y1 or box[1] < min(x0, x1) or box[0] > max(x0, x1):
            continue
        i0, j0 = m[0, 0] + m[0, 1] * x0 + m[0, 2] * y0, m[1, 0] + m[1, 1] * x0 + m[1, 2] * y0 + reach
        i1, j1 = m[0, 0] + m[0, 1] * x1 + m[0, 2] * y1, m[1, 0] + m[1, 1] * x1 + m[1, 2] * y1 + reach
        if (i0 <= left) != (i1 <= left):
            y = j0 + (left - i0) * (j1 - j0) / (i1 - i0)
            if 0 < y <= rows - 1:
                turned[math.ceil(y)] ^= True
                first, last = min(first, math.ceil(y)), rows
        if j0 > j1:
            i0, j0, i1, j1 = i1, j1, i0, j0
        if not j1 > j0:
            continue
        slope = (i1 - i0) / (j1 - j0)
        top, bottom = int(max(math.ceil(j0), 0.0)), int(min(math.ceil(j1), float(rows)))
        first, last = min(first, top), max(last, bottom)
        for j in range(top, bottom):
            i = i0 + (j - j0) * slope
            if i > left and i <= limit:
                k, c = count[j], math.ceil(i)
                while k > 0 and places[j, k - 1] > c:
                    places[j, k] = places[j, k - 1]
                    k -= 1
                places[j, k] = c
                count[j] += 1
    inside = corner
    for j in range(first, last):
        inside ^= turned[j]
        turned[j] = False
        if inside:
            for k in range(count[j], 0, -1):
                places[j, k] = places[j, k - 1]
            places[j, 0] = -reach
            count[j] += 1
    return first, last
