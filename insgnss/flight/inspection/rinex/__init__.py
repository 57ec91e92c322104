"""RINEX of rover, base and satellites in a directory, and the PPK that they allow."""
