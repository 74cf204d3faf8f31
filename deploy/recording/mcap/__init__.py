"""The recording as an MCAP file that standard viewers open."""
