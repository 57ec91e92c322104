"""What every room stands on: errors, units, whole files, TOML tables, caches of compiled code."""
