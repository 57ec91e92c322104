"""Tables of the block file that have a module of their own."""
