"""What a run left behind: read, replayed, compared, recovered, exported."""
