"""Database of a history: its address, its tables, and the migrations of its schema."""
