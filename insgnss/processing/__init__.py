"""From a flight file to its products: the steps of a run, each in a module of its own, and their order in `pipeline`."""
