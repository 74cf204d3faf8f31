"""Controllers from outside: found by hash, and a wall around each."""
