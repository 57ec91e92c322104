"""Files that came from others: what they may have written, shown and spent."""
