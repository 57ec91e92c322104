"""Compiled loops over all image observations of a block. Mathematics: `insgnss.adjust`."""
