"""Light to mean electrons on the chip: spots, blur, speckle, and the room's light."""

from perceptron_emu.image.ambient import ambient_electrons
from perceptron_emu.image.ghosts import ghost_electrons
from perceptron_emu.image.speckle import contrast, grain_px
from perceptron_emu.image.spots import draw

__all__ = [
    "ambient_electrons",
    "contrast",
    "draw",
    "ghost_electrons",
    "grain_px",
]
