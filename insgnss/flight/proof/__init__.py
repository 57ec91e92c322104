"""A synthetic scene in any format, for the tool that reads it.

Where the tool takes the file as it is meant, residuals are zero.
"""
