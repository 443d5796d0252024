"""One trial: an emulated cell, its frames, what came out."""
