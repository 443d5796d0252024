"""`python -m workbench` is `perceptron-emu`."""

from workbench.main import main

main()
