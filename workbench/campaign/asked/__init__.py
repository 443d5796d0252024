"""What is asked: the plan's file, a trial's settings, the design's points, the seed of each trial."""
