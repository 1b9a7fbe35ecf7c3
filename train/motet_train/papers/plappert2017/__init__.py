"""Plappert et al. 2017: language to motion by a mixture of frames; its page is docs/describe.md."""
