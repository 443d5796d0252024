"""Who does it: shards, worker processes, engines, the run from begin to end; a trial remade."""
