"""A scenario as a user writes it: read, checked whole, and resolved."""
