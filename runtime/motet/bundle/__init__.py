"""What is on disk: graphs and the manifest that says everything needed to run them."""
