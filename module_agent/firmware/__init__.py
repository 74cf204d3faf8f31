"""What one joint board computes. Pure: the tick is its only clock."""
