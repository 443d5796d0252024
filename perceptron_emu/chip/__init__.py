"""The chip: noise, exposures and grey levels, of randomness that any machine draws alike."""

from perceptron_emu.chip.camera import Image, expose, gain_dn_per_e
from perceptron_emu.chip.hashing import mix, mix_keys, white_noise
from perceptron_emu.chip.hdr import expose_hdr

__all__ = [
    "Image",
    "expose",
    "expose_hdr",
    "gain_dn_per_e",
    "mix",
    "mix_keys",
    "white_noise",
]
