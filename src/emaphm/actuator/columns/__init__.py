"""What an owner writes of the columns of a file: expressions of them, and their units."""
