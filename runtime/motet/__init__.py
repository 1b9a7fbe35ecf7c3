"""motet: sequence models of human motion, run by numpy and onnxruntime."""
