"""Measurements over many runs."""
