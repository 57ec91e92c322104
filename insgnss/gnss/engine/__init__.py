"""The PPK engine (RTKLIB): options, checks before the run, its processes."""
