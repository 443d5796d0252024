"""Images opened to tune detection on: pictures, names, truth, and the ranges of the parameters that are tuned."""
