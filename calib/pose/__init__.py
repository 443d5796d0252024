"""The target's pose in the sensor from one frame's points: all candidates, how likely each is, what is weak."""
