"""Models over HTTP, and to programs that speak the Motion Model Context Protocol."""
