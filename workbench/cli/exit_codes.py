"""Exit codes of the commands (docs/formats.md)."""

THRESHOLD = 1  # an answer, but a threshold failed
INPUT = 2  # unusable input or arguments
NO_ANSWER = 3  # no trustworthy answer
BUG = 70  # a fault of the program
INTERRUPTED = 130
