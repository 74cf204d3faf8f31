"""What came of a run: indices, tables, figures and the summary."""
