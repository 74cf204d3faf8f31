"""What the election period does to the motion."""
