"""What a run folder tells."""
