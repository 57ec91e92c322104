"""The keys of a flight file before their values are read: old names, and those of shared files."""
