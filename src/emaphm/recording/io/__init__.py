"""Reading and writing recordings, one file format a module."""
