"""What every room stands on: errors, units, whole files, TOML tables, the caches of compiled code."""
