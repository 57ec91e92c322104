"""A synthetic scene in any format, for the tool that reads it: where the tool takes the file as it
is meant, residuals are zero.
"""
