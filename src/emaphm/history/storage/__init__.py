"""The database of a history: where it is, its tables, and the steps from one form of it to the next."""
