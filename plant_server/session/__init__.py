"""The plant as the boards meet it: who is there, what is next, whose answer counts. Pure."""
