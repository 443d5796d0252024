"""Views of a target: what a sensor can see and an arm can reach, and which views tell most."""
