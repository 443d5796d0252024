"""The paper's experiment in emulation: recorded, calibrated and compared with its Table 1 and Fig. 7."""
