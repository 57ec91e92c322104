"""Files that appear together: scratch directories, moves, and marks of moves that did not end."""
