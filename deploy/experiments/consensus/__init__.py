"""How many rounds agreement takes, on any network, with boards alone."""
