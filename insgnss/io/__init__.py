"""One module a file format, in and out, and the options of its reader; which event is which
image.
"""
