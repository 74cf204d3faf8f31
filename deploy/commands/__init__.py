"""What is typed: a module for each group of commands, and how they speak."""
