"""Other people's localisers on the same windows, each in a process of its own; `extraction_spots.py` calls this.

Run: python benchmarks/spot_peers.py NAME in.npz out.npz   with images (N, side, side), read [e⁻] and width [px] in the
first; the second holds uv (M, 2) and the processor seconds of those M. Needs numpy and the peer alone.
"""

from __future__ import annotations

import sys
import time
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

import numpy as np

MAX_SLOW = 300  # spots for peers that take milliseconds each
DESKTOP = ("playsound3", "tifffile", "nd2", "psutil", "PyQt6", "imageio", "imageio_ffmpeg", "sqlalchemy", "tables")


class DesktopStub(MetaPathFinder, Loader):
    """Empty modules for what picassosr imports for its windows and files: `gaussmle` needs none of it."""

    def find_spec(self, name, path, target=None):
        """A stub for the names above, where they are not installed."""
        return ModuleSpec(name, self, is_package=True) if name.split(".")[0] in DESKTOP else None

    def create_module(self, spec):
        """An empty module whose every attribute is a class."""
        module = ModuleType(spec.name)
        module.__getattr__ = lambda name: type(name, (), {})
        return module

    def exec_module(self, module):
        """Nothing to run."""


def picassosr(images, read, width):
    """picasso.gaussmle, read noise added as a constant level as its authors advise."""
    sys.meta_path.append(DesktopStub())
    from picasso import gaussmle

    method = "sigmaxy" if width[0] != width[1] else "sigma"

    def locate(images):
        spots = np.ascontiguousarray(images + read**2, dtype=np.float32)
        return np.asarray(gaussmle.gaussmle(spots, 0.001, 100, method=method)[0])[:, :2]

    return locate, 2000


def photutils(images, read, width):
    """photutils.centroids.centroid_2dg, weighted by the true-to-type errors."""
    from photutils.centroids import centroid_2dg

    def locate(images):
        return [centroid_2dg(im - np.median(im), error=np.sqrt(np.maximum(im, 0.0) + read**2)) for im in images]

    return locate, MAX_SLOW


def sep(images, read, width):
    """sep.winpos, started at the true pixel."""
    import sep

    middle = [images.shape[1] // 2]

    def locate(images):
        found = []
        for im in images:
            u, v, _ = sep.winpos(np.ascontiguousarray(im - np.median(im)), middle, middle, [float(np.mean(width))])
            found.append((float(u[0]), float(v[0])))
        return found

    return locate, len(images)


def trackpy(images, read, width):
    """trackpy.locate, the brightest feature of each window."""
    import trackpy

    trackpy.quiet()

    def locate(images):
        found = [trackpy.locate(im - im.min(), 7, topn=1) for im in images]
        return [(f.x.iloc[0], f.y.iloc[0]) if len(f) else (np.nan, np.nan) for f in found]

    return locate, MAX_SLOW


PEERS = {
    "picassosr gaussmle": picassosr,
    "photutils centroid_2dg": photutils,
    "sep.winpos": sep,
    "trackpy.locate": trackpy,
}


def main() -> None:
    """Run one peer; exit 3 and the reason on standard error where it is not installed."""
    name, source, result = sys.argv[1:]
    with np.load(source) as given:
        images, read, width = given["images"], float(given["read"]), given["width"]
    try:
        locate, most = PEERS[name](images, read, width)
    except ImportError as error:
        print(error, file=sys.stderr)
        sys.exit(3)
    locate(images[:3])  # compile
    start = time.process_time()
    uv = np.asarray(locate(images[:most]), dtype=float)
    np.savez(result, uv=uv, seconds=time.process_time() - start)


if __name__ == "__main__":
    main()
