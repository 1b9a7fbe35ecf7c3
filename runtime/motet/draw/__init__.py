"""Drawing: a body on a skeleton, and pages and pictures of it."""
