"""Ways to bring a robot up, and to look at what it did."""
