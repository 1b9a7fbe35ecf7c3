"""Export of motet models from torch to ONNX bundles."""
