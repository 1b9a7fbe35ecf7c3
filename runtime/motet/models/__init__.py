"""What a user holds: one model for each verb."""
