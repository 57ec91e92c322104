"""What an option of a reader declares, and the table [camera] of the flight file."""

from . import sensor_kinds as sensor_kinds  # whoever imports an option finds its kind registered
