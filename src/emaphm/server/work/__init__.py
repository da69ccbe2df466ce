"""Work of the server in separate processes: diagnoses of uploads, prognoses, figures."""
