"""Delays of troposphere and ionosphere between base and rover, and their corrections."""
