"""Work that the server has done by processes of its own: diagnoses of uploads, prognoses, figures."""
