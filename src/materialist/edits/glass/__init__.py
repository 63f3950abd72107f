"""Turning an object to glass: closed proxy or the paper's two interfaces."""
