"""Who may use the studio, which files their requests may name, and how much they may send."""
