"""Text of a prognosis for a terminal and a page: hours, advice and tables."""
