"""The models that a user works with, one for each verb."""
