"""One step a file; a step that a release has shipped is never changed."""
