"""A board on a clock of its own: the same firmware, and nobody is waited for."""
