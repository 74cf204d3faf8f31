"""Robots brought up: as processes, in the twin, and who may use which ports and cores."""
