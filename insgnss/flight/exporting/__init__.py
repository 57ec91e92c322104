"""From the master exterior orientation to any format.

The room has the frame that the format carries, its options, and the verb `export`.
"""
