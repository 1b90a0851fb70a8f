"""Parts that commands share: the bracket around each, its options and surroundings, and what it prints."""
