"""What the frames talk of: scenario, commands, sensors, states, clocks and chance."""
