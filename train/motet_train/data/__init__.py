"""What models are trained on: one module per corpus."""
