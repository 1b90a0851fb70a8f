"""What engines document of constraints that they do not hold rigid, and of their steps, as plain data."""
