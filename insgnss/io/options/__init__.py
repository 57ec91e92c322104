"""What an option of a reader declares, and the table [camera] of the flight file."""
