"""What the recording itself says of units, senses, axes and clocks, and whether the flight file
agrees with it.
"""
