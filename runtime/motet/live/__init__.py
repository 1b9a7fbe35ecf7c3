"""Figures that are steered live: a page that steers one, a server of poses, and messages for avatars."""
