"""Formats of programs of which no file was at hand, so that open conventions could not be checked.

A format moves out of here when a file that its program wrote, or took, has been held against it.
Names on the command line stay; the files that are written say in their name and, where comments are
possible, in their head that they are experimental.
"""
