"""What every room stands on: errors, units, whole files, TOML tables, caches of compiled code."""

__version__ = "0.2.0"
