"""Reading and writing recordings, with one module for each file format."""
