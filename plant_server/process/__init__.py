"""The plant as an operating-system process: sessions, loops and signals."""
