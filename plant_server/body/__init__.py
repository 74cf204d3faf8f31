"""The mechanics: chains of links, what holds them, and what pushes them."""
