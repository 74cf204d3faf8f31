"""Sections of the report, one each."""
