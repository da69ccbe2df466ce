"""Who may use the server: tokens, checks of every request, and limits of a connection."""
