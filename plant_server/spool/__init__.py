"""What a run leaves behind while it goes on."""
