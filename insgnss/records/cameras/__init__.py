"""The camera of Brown's model on arrays, and how it is mounted on the body."""
