"""Tables of a vehicle whose target images see: where it was, and how large it appears."""
