"""A stream of rows on a pipe as a source: parsing, ordering, and collection into movements."""
