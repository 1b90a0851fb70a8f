"""The rows of what a file ties beside its joints, the mechanisms that they tie, and how softly."""
