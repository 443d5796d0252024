"""Fixed-point closure: a tool's point seated again and again in the same socket, joint readings alone."""
