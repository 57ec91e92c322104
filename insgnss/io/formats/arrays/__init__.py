"""Files of named arrays (MATLAB, numpy), read by a column map."""
