"""Is σ true? Reported σ over the scatter of string spots on rendered frames, by the string's diameter.

Every frame has its own pose and its own thread between matte white and dark glossy; the speckle is learnt from the
first frames of a case. Spots without a flag of strings that are seen whole and apart, along and across the light [px].
σ/scatter: root mean square σ over the errors' standard deviation; σ/rms: over their root mean square, which holds the
mean error too. Optics: presets; "nominal-0": the nominal sensor with dark pixels at grey level 0, "fine": 5 million
pixels of 3.45 µm, 12 bits.
Run: python benchmarks/extraction_sigma.py [--frames 150] [--first 1] [--optics nominal fine ...] [--diameters 0.3 ...]
"""

from __future__ import annotations

import argparse
import time

import cv2
import numpy as np
from rendered_strings import Emulated, frames, optics, spot_errors

from extraction import learn_speckle

LEARNT = 60  # frames
DIAMETERS = (0.1, 0.2, 0.3, 0.5, 1.0)


def case(seen_by: Emulated, diameter_mm: float, count: int, seed: int) -> str:
    """One line: a sensor and a string."""
    rendered = frames(seen_by, diameter_mm, count, np.random.default_rng((seed, int(1000 * diameter_mm))))
    config = learn_speckle([f.image for f in rendered[:LEARNT]], seen_by.sensor)
    error, variance = spot_errors(rendered, seen_by.sensor, config)
    if len(error) < 10:
        return f"only {len(error)} spots"
    sigma = np.sqrt(variance.mean(axis=0))
    scatter, mean, rms = error.std(axis=0), error.mean(axis=0), np.sqrt(np.mean(error**2, axis=0))
    pairs = [sigma / scatter, sigma / rms, (error / np.sqrt(variance)).std(axis=0), scatter, mean]
    digits = (2, 2, 2, 4, 4)
    text = "  ".join(f"{a:7.{d}f} {b:7.{d}f}" for (a, b), d in zip(pairs, digits, strict=True))
    return f"{len(error):6d}  {config.noise.speckle_contrast:.3f} {config.noise.speckle_grain_px:.2f}  {text}"


def main() -> None:
    """Print a line per sensor, string and speckle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=150, help="frames a case")
    parser.add_argument("--first", type=int, default=1, help="seed")
    parser.add_argument("--optics", nargs="+", default=["nominal", "nominal-0", "fine"])
    parser.add_argument("--diameters", nargs="+", type=float, default=DIAMETERS, help="mm")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    start = time.process_time()
    print(f"{'':32}{'spots':>6}  {'speckle':>10}  {'σ/scatter':>15}  {'σ/rms error':>15}  {'error/σ':>15}  "
          f"{'scatter px':>15}  {'mean px':>15}")  # fmt: skip
    for name in given.optics:
        for speckle in (True, False):
            for diameter in given.diameters:
                seen_by = optics(name) if speckle else optics(name).plain()
                line = case(seen_by, diameter, given.frames, given.first)
                print(f"{name:16}{'speckle' if speckle else 'none':8}{diameter:4.1f} mm {line}", flush=True)
    print(f"{time.process_time() - start:.0f} s of processor time")


if __name__ == "__main__":
    main()
