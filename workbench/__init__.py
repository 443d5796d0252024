"""The roof: files, the command line, recording, planning, reports, campaigns and the process window.

Its rooms, lower ones first; each is used through its face only:

files      the formats of docs/formats.md, read strictly and written whole or not at all
compare    measured points beside their truth: one matcher, one set of figures
cell       a cell's frames measured, labelled and solved; presets; what stands around a jig
plan       views that a sensor can measure and an arm can reach, and the most telling of them
emulate    cells recorded in emulation, with their truth
opened     images opened to tune detection on, and the ranges of what is tuned
report     JSON, tables, pictures, and the kit of all HTML pages
validate, tune, campaign, demo, window
           the tools, none of which knows another
answered   a dataset calibrated in one call, for scripts
cli        commands, imported when they are called
"""

__all__ = ["CalibratedCell", "calibrate_cell"]


def __getattr__(name: str) -> object:
    """What scripts take from here, imported when it is asked for: a command's start must not wait for it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from workbench import answered

    return getattr(answered, name)
