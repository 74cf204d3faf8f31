"""The page that tells of one or more runs."""
