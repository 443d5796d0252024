"""`python -m workbench` is `perceptron-emu`."""

from workbench.cli.main import main

main()
