"""What is on the wire: frames, keys, and who listens where. Bytes and names, nothing else."""
