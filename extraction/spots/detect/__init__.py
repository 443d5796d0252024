"""Where spots may be: the matched blur, the frame's background and noise, peaks, and the lit region around each."""

from extraction.spots.detect.blur import BLOCK_PX, Image32
from extraction.spots.detect.candidates import Candidates, find_candidates
from extraction.spots.detect.prepare import PreparedImage, block_share, filled, prepare

__all__ = ["BLOCK_PX", "Candidates", "Image32", "PreparedImage", "block_share", "filled", "find_candidates", "prepare"]
