"""All frames at once: SCP, places of the target, robot and shape, with outliers, noise and covariance."""
