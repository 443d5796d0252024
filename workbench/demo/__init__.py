"""The paper's experiment in emulation: recorded, calibrated and compared with its Table 1 and Fig. 7."""

from workbench.demo.compare import print_demo
from workbench.demo.run import run_demo

__all__ = [
    "print_demo",
    "run_demo",
]
