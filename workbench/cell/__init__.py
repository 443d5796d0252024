"""A cell and its frames: found by name, measured, labelled and solved."""
