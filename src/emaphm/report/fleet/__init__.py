"""The page of the study of a synthetic fleet."""
