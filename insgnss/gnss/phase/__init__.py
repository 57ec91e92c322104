"""Carrier phases and their delays: time differences (TDCP), double differences, velocity.

Cycle slips and C/N0 are judged here, too; the ionosphere is measured on double differences.
"""
