"""What every process of a robot shares: exit codes, stopping, what it runs on."""
