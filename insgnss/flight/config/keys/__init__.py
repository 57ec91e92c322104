"""The keys of a flight file before their values are read.

Old names, those of shared files, and fields that a caller gives.
"""
