"""Charts of the report, one each."""
