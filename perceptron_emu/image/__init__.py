"""Light to mean electrons on the chip: spots, blur, speckle, and the room's light."""

from perceptron_emu.image.ambient import ambient_electrons
from perceptron_emu.image.ghosts import ghost_electrons
from perceptron_emu.image.speckle import contrast as speckle_contrast
from perceptron_emu.image.speckle import grain_px
from perceptron_emu.image.spots import draw

__all__ = [
    "ambient_electrons",
    "draw",
    "ghost_electrons",
    "grain_px",
    "speckle_contrast",
]
