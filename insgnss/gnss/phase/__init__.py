"""Carrier phases: differences in time (TDCP) and double differences, velocity, cycle slips and
C/N0.
"""
