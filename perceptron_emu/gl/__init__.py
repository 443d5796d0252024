"""Off-screen OpenGL through pyrender: the second renderer, and pictures of the cell. Importing it needs no OpenGL."""

from perceptron_emu.gl.backend import light_scene_gl
from perceptron_emu.gl.context import gl_problem
from perceptron_emu.gl.picture import CellView, cell_picture
from perceptron_emu.gl.world import GlView, depth_and_identity, gl_world

__all__ = [
    "CellView",
    "GlView",
    "cell_picture",
    "depth_and_identity",
    "gl_problem",
    "gl_world",
    "light_scene_gl",
]
