"""Camera events, one module a format."""
