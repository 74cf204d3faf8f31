"""Tables that documents take from the code, between marks: `python -m deploy.generated`."""
