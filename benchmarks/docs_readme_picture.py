"""The picture of the README, from a finished demo: a stripe image with its labelled spots above Fig. 7.

python benchmarks/docs_readme_picture.py demo docs/pictures/readme.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

WIDTH = 1100


def main() -> None:
    """Read overlays/003.png and fig7.png of the demo's folder, write one picture."""
    demo, out = Path(sys.argv[1]), Path(sys.argv[2])
    parts = [cv2.imread(str(demo / name)) for name in ("overlays/003.png", "fig7.png")]
    if any(p is None for p in parts):
        sys.exit(f"{demo}: no overlays/003.png and fig7.png; run `perceptron-emu demo` first")
    scaled = [
        cv2.resize(p, (WIDTH, round(p.shape[0] * WIDTH / p.shape[1])), interpolation=cv2.INTER_AREA) for p in parts
    ]
    top = scaled[0][round(0.38 * len(scaled[0])) : round(0.92 * len(scaled[0]))]
    out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(out), np.vstack([top, scaled[1]]), [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main()
