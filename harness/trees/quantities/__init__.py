"""What engines compute of a tree beside accelerations, along the world's axes."""
