"""Which spot is which string: labels of frames and locations, and the way from the lit surface to the axis."""
