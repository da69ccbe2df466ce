"""How a prognosis is said: hours, advice and tables as text, for a terminal and a page."""
