"""From the master exterior orientation to any format: the frame that the format carries, its
options, and the verb `export`.
"""
