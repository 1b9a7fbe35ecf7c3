"""The thesis: a temporal deep belief net of RBM and CRBM for live control; its page is docs/results/tdbn.md."""
