"""The commands of `perceptron-emu`: a module each, imported when it is called (workbench/cli/lazy.py lists them)."""
