"""Results as HTML pages, and as a card in a notebook."""
