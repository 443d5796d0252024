"""Where it is kept: the run's folder, its shards and tables, its manifest and numeric environments."""
